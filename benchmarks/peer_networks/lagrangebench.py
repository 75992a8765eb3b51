"""The GNS of LagrangeBench (JAX) for ``benchmarks/peers.py``.

Only the files of the network are imported, not the whole package, which needs libraries that it never touches here.
"""

import os
import sys
from pathlib import Path
from types import ModuleType

import haiku as hk
import jax
import jax.numpy as jnp
import numpy as np
from timing import report

SOURCE = Path(os.environ["PYTHONPATH"]) / "lagrangebench"
for name, folder in (("lagrangebench", SOURCE), ("lagrangebench.models", SOURCE / "models")):
    sys.modules[name] = ModuleType(name)
    sys.modules[name].__path__ = [str(folder)]

from lagrangebench.models.gns import GNS  # noqa: E402

given = {name: jnp.asarray(values) for name, values in np.load(sys.argv[1]).items()}
features = {
    "vel_hist": given["nodes"],
    "rel_disp": given["edges"][:, :3],
    "rel_dist": given["edges"][:, 3:],
    "senders": given["senders"],
    "receivers": given["receivers"],
}
kinds = jnp.zeros(len(given["nodes"]), dtype=int)
# Its layers are counted with the last one: three are two hidden ones.
network = hk.without_apply_rng(hk.transform(lambda seen: GNS(3, 128, 3, 10, 16, num_particle_types=1)((seen, kinds))))
weights = network.init(jax.random.PRNGKey(0), features)
pass_forward = jax.jit(network.apply)
pass_both = jax.jit(jax.grad(lambda w, seen: jnp.square(network.apply(w, seen)["acc"]).mean()))


def forward() -> None:
    """A pass without gradients."""
    jax.block_until_ready(pass_forward(weights, features))


def both() -> None:
    """A pass with all gradients."""
    jax.block_until_ready(pass_both(weights, features))


report(forward, both, f"jax {jax.__version__}, dm-haiku {hk.__version__}")
