"""Judge weights by rollouts with and without the guard, and by how a released block falls in rooms of several sizes.

    python judge.py NAME WEIGHTS_OR_RUN [--scenes 4] [--frames 240] [--folder data/validation] [--no-guard-only]

A line of JSON per judgement is appended to results.jsonl. Never give it a test set.
"""
import argparse, json, sys, time
from pathlib import Path
import numpy as np, torch
torch.set_num_threads(1)
from surfsup.errors import SimulationError
from surfsup.evaluation.judge import first_trajectories
from surfsup.evaluation.metrics import chamfer, centre_height, kinetic_energy, highest_density, tree
from surfsup.evaluation.rollout import while_sound
from surfsup.model import weights
from surfsup.model.state import Surroundings
from surfsup.scene import Scene
from surfsup.training.run import Run
from surfsup.trajectory import Trajectory

FALLS = {
 "usual room": "{surface: {sphere: {radius: 0.35}, at: [0,0,0.35]}, fluid: [{block: {min: [-0.22,-0.22,1.2], max: [0.22,0.22,1.62]}}]}",
 "2x2x2": "{container: {size: [2,2,2]}, surface: {sphere: {radius: 0.35}, at: [0,0,0.35]}, fluid: [{block: {min: [-0.22,-0.22,1.2], max: [0.22,0.22,1.62]}}]}",
 "2x2x2 aside": "{container: {size: [2,2,2]}, surface: {sphere: {radius: 0.35}, at: [0.6,0.6,0.35]}, fluid: [{block: {min: [-0.7,-0.7,1.2], max: [-0.26,-0.26,1.62]}}]}",
 "2x2x2 empty": "{container: {size: [2,2,2]}, fluid: [{block: {min: [-0.22,-0.22,1.2], max: [0.22,0.22,1.62]}}]}",
 "2x2x2 large": "{container: {size: [2,2,2]}, surface: {sphere: {radius: 0.35}, at: [0,0,0.35]}, fluid: [{block: {min: [-0.4,-0.4,1.2], max: [0.4,0.4,1.62]}}]}",
}
FALL_FRAMES = 40

def load(what):
    path = Path(what)
    if path.is_dir():
        return Run.average_of(path).eval().requires_grad_(False)
    return weights.load(weights.find(what))[0]

@torch.no_grad()
def falls(model):
    """By how much the centre of the released block is too high after FALL_FRAMES, as a share of its fall; and the spread it has got."""
    out = {}
    for name, text in FALLS.items():
        scene = Scene.from_yaml(text, name)
        surface = scene.build_surface()
        around = Surroundings.of(scene, surface)
        start = scene.start(surface)
        state = model.start(torch.from_numpy(start.positions), torch.from_numpy(start.particle_velocities), around)
        first = start.positions
        for now, _ in while_sound(model.rollout(state, around, FALL_FRAMES + 1, False)):
            pass
        n = FALL_FRAMES * 5
        true = -9.81e-6 * n * (n + 1) / 2
        moved = now.positions.numpy() - first
        out[name] = [round(float(1 - moved[:, 2].mean() / true), 4), round(float(np.sqrt(np.square(moved - [0, 0, true]).sum(1).mean())), 4)]
    return out

@torch.no_grad()
def roll(model, path, frames, guarded):
    with Trajectory(path) as truth:
        surface = truth.scene.build_surface()
        around = Surroundings.of(truth.scene, surface)
        frames = min(frames, len(truth))
        tp, tv = truth.positions[:frames], truth.velocities[:frames]
    state = model.start(torch.from_numpy(tp[0]), torch.from_numpy(tv[0]), around)
    r = dict(cd={}, height=[], e=[], te=[], inside=0, outside=0, density=[], lost=0)
    last = 0
    for f, (now, moved) in enumerate(while_sound(model.rollout(state, around, frames, guarded))):
        last = f
        p, v = now.positions.numpy(), now.velocities.numpy()
        if f % 5 == 0:
            r["cd"][f] = chamfer(p, tp[f]).plain
        if f % 20 == 0:
            r["density"].append(highest_density(tree(p)))
        r["height"].append(abs(centre_height(p) - centre_height(tp[f])))
        r["e"].append(kinetic_energy(v)); r["te"].append(kinetic_energy(tv[f]))
        if surface is not None:
            r["inside"] += int((around.surface.distance(now.positions) < 0).sum())
        out = ((now.positions < around.lower) | (now.positions > around.upper)).any(-1)
        r["outside"] += int(out.sum()); r["lost"] = int(out.sum())
    cd = r["cd"]
    return dict(chamfer=float(np.mean(list(cd.values()))) if last == frames - 1 else float("nan"),
                early=float(np.mean([cd.get(f, np.nan) for f in (30, 40, 50)])),
                at100=cd.get(100, float("nan")), height=float(np.mean(r["height"])),
                energy=sum(r["e"]) / sum(r["te"]), inside=r["inside"], outside=r["outside"], lost=r["lost"],
                density=float(np.max(r["density"])), frames=last + 1)

STARTS = (10, 60, 75, 90, 110, 150, 200)

@torch.no_grad()
def ten(model, paths):
    """Mean distance from the truth, mm, ten unguarded frames after true states; by the frame they begin at. Chaos is no part of it yet."""
    out = {}
    for first in STARTS:
        every = []
        for path in paths:
            with Trajectory(path) as truth:
                around = Surroundings.of(truth.scene, truth.scene.build_surface())
                a = first - model.past
                p, v = (torch.from_numpy(x[a:first + 11]) for x in (truth.positions, truth.velocities))
            state = model.state_after(p[:model.past + 1], v[:model.past + 1])
            for _ in range(10):
                state, _ = model.step(state, around, False)
            every.append(float((state.positions - p[-1]).norm(dim=-1).mean()) * 1000)
        out[first] = round(float(np.mean(every)), 3)
    return out

def main():
    a = argparse.ArgumentParser()
    a.add_argument("name"); a.add_argument("weights")
    a.add_argument("--scenes", type=int, default=3); a.add_argument("--frames", type=int, default=220)
    a.add_argument("--folder", default="data/validation")
    a.add_argument("--guards", default="off,on"); a.add_argument("--no-falls", action="store_true")
    a.add_argument("--rooms", default="", help="comma-separated, else all five")
    a = a.parse_args()
    for name in list(FALLS):
        if a.rooms and name not in a.rooms.split(","):
            del FALLS[name]
    t = time.time()
    model = load(a.weights)
    if hasattr(model, "network"):  # bf16 around the network alone, as in training
        own = model.predict
        def predict(seen):
            with torch.autocast("cpu", torch.bfloat16):
                return own(seen)
        model.predict = predict
    row = dict(name=a.name, folder=Path(a.folder).name, scenes=a.scenes, frames=a.frames)
    if not a.no_falls:
        row["falls"] = falls(model)
        print("falls", row["falls"], flush=True)
    row["ten"] = ten(model, first_trajectories(Path(a.folder), a.scenes))
    print("ten frames, mm", row["ten"], round(float(np.mean(list(row["ten"].values()))), 3), flush=True)
    for guard in [g for g in a.guards.split(",") if g]:
        every = [roll(model, p, a.frames, guard == "on") for p in first_trajectories(Path(a.folder), a.scenes)]
        mean = {k: (sum(e[k] for e in every) if k in ("inside", "outside", "lost") else round(float(np.mean([e[k] for e in every])), 5)) for k in every[0]}
        row[guard] = mean; row[guard + "_each"] = every
        print(guard, mean, flush=True)
        for e in every: print("   ", {k: (round(v, 4) if isinstance(v, float) else v) for k, v in e.items()}, flush=True)
    row["seconds"] = round(time.time() - t)
    with open("results.jsonl", "a") as f: f.write(json.dumps(row) + "\n")
    print(a.name, "judged in", row["seconds"], "s")

main()
