"use strict";
// Shows the report's numbers as tables and charts. The page contains all of them and fetches nothing.

const report = JSON.parse(document.getElementById("report").textContent);
const byId = (id) => document.getElementById(id);
const metrics = report.metrics, metric = Object.fromEntries(metrics.map((one) => [one.key, one]));
const chosen = { data: report.data.find((one) => one.scenes).name, scene: null, window: "all", sort: null, descending: true };

// ---- text and numbers
const escape = (text) => String(text).replace(/[&<>"']/g, (c) => `&#${c.charCodeAt(0)};`);
const minus = (text) => text.replace("-", "\u2212");
function format(value, one) {
  if (value === null || value === undefined) return "\u2013";
  return minus(value.toFixed(one.decimals || Number.isInteger(value) ? one.decimals : 1));
}
const times = (ratio) => ratio === null || ratio === undefined ? "" : `\u00d7${ratio < 100 ? ratio.toFixed(2) : ratio.toFixed(0)}`;
const plural = (count, word) => `${count} ${word}${count === 1 ? "" : "s"}`;
const longest = Math.max(...report.scenes.map((one) => one.frames));
const windowName = (name) => name.replace("end", longest).replace(/^all$/, `all ${longest}`).replace(/-/, "\u2013");
const scenesOf = (data) => report.scenes.filter((one) => one.data === data);
const meanOf = (data, surface) => report.means.find((one) => one.data === data && one.surface === surface);

// ---- tables
function cell(values) {
  return metrics.map((one) => {
    const found = values && values[one.key];
    if (!found) return "<td>\u2013</td>";
    const floor = found.floor === null ? "" : `<small>${format(found.floor, one)} <b>${times(found.ratio)}</b></small>`;
    return `<td>${format(found.prediction, one)}${floor}</td>`;
  }).join("");
}
function head(first) {
  const names = metrics.map((one) => `<th scope="col" data-key="${one.key}" title="${escape(one.description)}">${escape(one.name)}<small>${escape(one.unit) || "&nbsp;"}</small></th>`);
  return `<thead><tr><th scope="col">${first}</th>${names.join("")}</tr></thead>`;
}
function bySurface() {
  let rows = "";
  for (const data of report.data.filter((one) => one.scenes)) {
    rows += `<tr class="group"><th colspan="${metrics.length + 1}">${escape(data.name)}</th></tr>`;
    for (const mean of report.means.filter((one) => one.data === data.name)) {
      const row = mean.surface === "all" ? ' class="whole"' : "";
      rows += `<tr${row}><th scope="row">${escape(mean.surface)} (${mean.scenes})</th>${cell(mean.windows[chosen.window])}</tr>`;
    }
  }
  byId("by-surface").innerHTML = `${head("surface (scenes)")}<tbody>${rows}</tbody>`;
}
function byTime() {
  const windows = meanOf(chosen.data, "all").windows;
  const rows = Object.keys(windows).map((name) =>
    `<tr${name === "first 300" ? ' class="whole"' : ""}><th scope="row">${windowName(name)}</th>${cell(windows[name])}</tr>`);
  byId("by-time").innerHTML = `${head("frames")}<tbody>${rows.join("")}</tbody>`;
}
function everyScene() {
  const value = (scene) => { const w = scene.windows[chosen.window]; return w ? w[chosen.sort].prediction : null; };
  const rank = (scene) => { const v = value(scene); return v === null ? (chosen.descending ? Infinity : -Infinity) : v; };
  const scenes = scenesOf(chosen.data).slice();
  if (chosen.sort) scenes.sort((a, b) => (chosen.descending ? rank(b) - rank(a) : rank(a) - rank(b)) || 0);
  const rows = scenes.map((scene) => {
    const link = `<a href="${escape(scene.trajectory.split("/").map(encodeURIComponent).join("/"))}" title="the simulator's rollout, HDF5">trajectory</a>`;
    const name = `<button class="link" data-scene="${escape(scene.scene)}">${escape(scene.scene)}</button> ${escape(scene.surface)}`;
    return `<tr${scene.scene === chosen.scene ? ' class="chosen"' : ""}><th scope="row">${name}<br><small>${link}</small></th>${cell(scene.windows[chosen.window])}</tr>`;
  });
  byId("scenes").innerHTML = `${head("scene")}<tbody>${rows.join("")}</tbody>`;
}
byId("scenes").addEventListener("click", (event) => {
  const button = event.target.closest("button[data-scene]"), column = event.target.closest("th[data-key]");
  if (button) { chosen.scene = chosen.scene === button.dataset.scene ? null : button.dataset.scene; show(); }
  if (column) { chosen.descending = chosen.sort === column.dataset.key ? !chosen.descending : true; chosen.sort = column.dataset.key; everyScene(); }
});

// ---- tiles
function tiles() {
  const values = meanOf(chosen.data, "all").windows[chosen.window];
  const items = ["chamfer", "surface", "height", "energy", "density", "penetration", "lost"].map((key) => {
    const one = metric[key], found = values && values[key];
    const floor = !found || found.floor === null ? "no floor" : `floor ${format(found.floor, one)} &nbsp;<b>${times(found.ratio)}</b>`;
    return `<div class="tile" title="${escape(one.description)}"><div class="name">${escape(one.name)}</div>`
      + `<div class="value">${format(found && found.prediction, one)} <small>${escape(one.unit)}</small></div><div class="floor">${floor}</div></div>`;
  });
  byId("tiles").innerHTML = items.join("");
}

// ---- curves: of one scene, or the mean of all scenes of a data set
const SOURCES = [["prediction", "prediction"], ["reference", "reference"], ["floor", "floor-line"]]; // curve, CSS class
function curvesOf(scenes) {
  const found = {};
  for (const name of Object.keys(scenes[0].curves)) {
    found[name] = {};
    for (const [source] of SOURCES) {
      const all = scenes.map((scene) => scene.curves[name][source]).filter(Boolean);
      if (!all.length) continue;
      // A diverged scene leaves a gap. A mean without it would look too good.
      found[name][source] = Array.from({ length: Math.max(...all.map((one) => one.length)) }, (_, k) => {
        const values = all.filter((one) => k < one.length).map((one) => one[k]);
        return values.some((v) => v === null) ? null : values.reduce((a, b) => a + b, 0) / values.length;
      });
    }
  }
  // The energy ratio is computed for each scene: the ratio of sums would show only the wildest scene.
  found.energyRatio = {};
  for (const source of ["prediction", "floor"]) {
    const energies = scenes.map((scene) => scene.curves.energy).filter((one) => one[source]);
    const all = energies.map((one) => energyRatio(one[source], one.reference));
    if (all.length) found.energyRatio[source] = Array.from({ length: Math.max(...all.map((one) => one.length)) }, (_, k) => {
      const ratios = all.map((one) => one[k]).filter((v) => v > 0);
      if (!ratios.length || energies.some((one) => one[source][k] === null)) return null;
      return Math.exp(ratios.reduce((a, b) => a + Math.log(b), 0) / ratios.length);
    });
  }
  return found;
}
const HALF_WINDOW = 0.06; // seconds, of the moving average
function energyRatio(curve, reference) {
  const reach = Math.round(HALF_WINDOW / step), most = Math.max(...reference.filter((v) => v !== null));
  return curve.map((_, k) => {
    let a = 0, b = 0;
    for (let j = Math.max(0, k - reach); j <= Math.min(curve.length - 1, k + reach); j++) {
      if (curve[j] === null || reference[j] === null || reference[j] === undefined) return null;
      a += curve[j]; b += reference[j];
    }
    return b > 1e-6 * most ? a / b : null;
  });
}
const isNumber = (v) => v !== null && v !== undefined;
const differenceInMm = (curve, reference) => curve && reference && curve.map((v, k) => isNumber(v) && isNumber(reference[k]) ? 1000 * (v - reference[k]) : null);
const step = report.stride * report.frame_time;

const CHARTS = [
  { title: "Chamfer distance", unit: "m", description: "Distance to the nearest particle of the other set, both directions. The floor is the solver against itself.", of: (c) => c.chamfer },
  { title: "Height of the center of mass", unit: "m", description: "Fall, rebound, rest.", of: (c) => c.height },
  { title: "Kinetic energy", unit: "J/kg", description: "Mean over particles; logarithmic, because water at rest has a thousandth of the peak.", of: (c) => c.energy, log: true },
  { title: "Chamfer Surface", unit: "m", description: `Summed over the particles within ${report.near} m of the solid.`, of: (c) => c.surface },
  { title: "Height error", unit: "mm", description: "Above zero the water is too high, below zero too low.", signed: true,
    of: (c) => ({ prediction: differenceInMm(c.height.prediction, c.height.reference), floor: differenceInMm(c.height.floor, c.height.reference) }) },
  { title: "Energy over the reference's", unit: "", description: "Below 1 the water is too calm, above 1 too wild. Smoothed over 0.12 s, geometric mean of scenes.", unitLine: true, max: 4,
    of: (c) => c.energyRatio },
];

function niceTicks(low, high, count) {
  const raw = (high - low) / count, power = 10 ** Math.floor(Math.log10(raw));
  const size = [1, 2, 5, 10].map((m) => m * power).find((s) => s >= raw - 1e-12 * power);
  const ticks = [];
  for (let v = Math.ceil(low / size - 1e-9) * size; v <= high + 1e-9 * size; v += size) ticks.push(Math.abs(v) < 1e-9 * size ? 0 : v);
  return { ticks, places: Math.max(0, -Math.floor(Math.log10(size) + 1e-9)) };
}
function range(spec, curves) {
  let low = Infinity, high = -Infinity;
  for (const values of curves) for (const v of values) if (v !== null) { low = Math.min(low, v); high = Math.max(high, v); }
  if (!(high >= low)) return [0, 1];
  if (spec.log) { const top = 10 ** Math.ceil(Math.log10(Math.max(high, 1e-12))); return [Math.max(top * 1e-6, 10 ** Math.floor(Math.log10(Math.max(low, 1e-12)))), top]; }
  if (!spec.signed) low = 0; else { low = Math.min(low, 0); high = Math.max(high, 0); }
  if (spec.unitLine) high = Math.max(1.2, Math.min(high, spec.max));
  if (high === low) high = low + 1;
  return [spec.signed ? low - 0.05 * (high - low) : low, high + 0.05 * (high - low)];
}

let drawn = [];
function drawCharts() {
  const all = scenesOf(chosen.data).filter((one) => !chosen.scene || one.scene === chosen.scene);
  const withFloor = all.filter((one) => one.repeats), scenes = withFloor.length ? withFloor : all; // curves of the same scenes only
  const curves = curvesOf(scenes);
  const members = scenes.length === all.length ? plural(all.length, "scene") : `${scenes.length} of ${all.length} scenes that have a floor`;
  byId("curves-of").textContent = chosen.scene
    ? `Scene ${chosen.scene} of ${chosen.data}: ${scenes[0].surface}, ${scenes[0].particles.toLocaleString("en")} particles.`
    : `Mean of the ${members}, data set ${chosen.data}.`;
  byId("legend").innerHTML = [["prediction", escape(report.simulator.name)], ["reference", "reference (SPlisHSPlasH)"],
    ...(withFloor.length ? [["floor-line", "floor: the reference with its water moved by 1 mm"]] : [])]
    .map(([kind, text]) => `<span><svg width="34" height="6" style="width:34px"><line x1="1" x2="33" y1="3" y2="3" class="${kind}" stroke-width="2"/></svg>${text}</span>`).join("");
  byId("charts").innerHTML = CHARTS.map((spec, number) =>
    `<div class="chart" data-chart="${number}"><h3>${spec.title}${spec.unit ? `, ${spec.unit}` : ""}</h3><p>${spec.description}</p></div>`).join("");
  drawn = CHARTS.map((spec, number) => draw(byId("charts").children[number], spec, spec.of(curves)));
}
function draw(box, spec, curves) {
  const sources = SOURCES.filter(([source]) => curves[source]);
  const width = box.clientWidth - 24, height = 210, left = 46, right = 8, top = 8, bottom = 34;
  const frames = Math.max(2, ...sources.map(([source]) => curves[source].length)), end = frames * step;
  const [low, high] = range(spec, sources.map(([source]) => curves[source]));
  const x = (seconds) => left + (seconds / end) * (width - left - right);
  const scale = spec.log ? (v) => Math.log10(Math.max(v, low) / low) / Math.log10(high / low) : (v) => (v - low) / (high - low);
  const y = (v) => top + (1 - scale(v)) * (height - top - bottom);
  let body = "";
  const line = (v, text) => `<line class="grid" x1="${left}" x2="${width - right}" y1="${y(v)}" y2="${y(v)}"/><text x="${left - 6}" y="${y(v) + 4}" text-anchor="end">${text}</text>`;
  if (spec.log) {
    for (let power = Math.round(Math.log10(low)); power <= Math.round(Math.log10(high)); power++)
      body += line(10 ** power, power < -2 || power > 3 ? `10<tspan dy="-4" font-size="9">${minus(String(power))}</tspan>` : String(10 ** power));
  } else {
    const { ticks, places } = niceTicks(low, high, 5);
    for (const v of ticks) body += line(v, minus(v.toFixed(places)));
  }
  const times = niceTicks(0, end, width < 320 ? 4 : 8);
  for (const v of times.ticks) body += `<line class="axis" x1="${x(v)}" x2="${x(v)}" y1="${height - bottom}" y2="${height - bottom + 4}"/><text x="${x(v)}" y="${height - bottom + 17}" text-anchor="middle">${v.toFixed(times.places)}</text>`;
  body += `<line class="axis" x1="${left}" x2="${width - right}" y1="${y(spec.unitLine ? 1 : spec.signed ? 0 : low)}" y2="${y(spec.unitLine ? 1 : spec.signed ? 0 : low)}" stroke-width="1.5"/>`;
  body += `<text x="${width - right}" y="${height - 3}" text-anchor="end">time, s</text>`;
  for (const [source, kind] of sources) {
    let path = "", pen = "M";
    curves[source].forEach((v, k) => {
      if (v === null || (spec.log && v <= 0)) { pen = "M"; return; }
      path += `${pen}${x(k * step).toFixed(1)} ${y(Math.min(v, high)).toFixed(1)}`; pen = "L";
    });
    body += `<path class="curve ${kind}" d="${path}"/>`;
  }
  body += `<line class="now" y1="${top}" y2="${height - bottom}"/>`;
  box.insertAdjacentHTML("beforeend", `<svg role="img" aria-label="${escape(spec.title)} over time" height="${height}">${body}</svg>`);
  return { svg: box.querySelector("svg"), spec, curves, sources, frames, end, left, right, width, x };
}

// ---- the values under the pointer, with a line at that time in every chart
const tip = byId("tip");
byId("charts").addEventListener("pointermove", (event) => {
  const box = event.target.closest(".chart");
  if (!box) return hide();
  const chart = drawn[Number(box.dataset.chart)], at = event.clientX - chart.svg.getBoundingClientRect().left;
  const k = Math.round(((at - chart.left) / (chart.width - chart.left - chart.right)) * chart.frames);
  if (k < 0 || k >= chart.frames) return hide();
  for (const one of drawn) {
    const now = one.svg.querySelector(".now"), x = one.x(k * step);
    now.setAttribute("x1", x); now.setAttribute("x2", x);
    now.style.visibility = k < one.frames ? "visible" : "hidden";
  }
  const rows = chart.sources.map(([source]) => {
    const v = chart.curves[source][k];
    return `<tr><td>${source}</td><td>${isNumber(v) ? minus(v.toPrecision(3)) : "\u2013"} ${chart.spec.unit}</td></tr>`;
  });
  tip.innerHTML = `${(k * step).toFixed(2)} s, frame ${k * report.stride}<table>${rows.join("")}</table>`;
  tip.style.visibility = "visible";
  const size = tip.getBoundingClientRect();
  tip.style.left = `${Math.max(4, event.clientX + 16 + size.width > innerWidth ? event.clientX - 16 - size.width : event.clientX + 16)}px`;
  tip.style.top = `${Math.max(4, event.clientY - size.height - 12)}px`;
});
function hide() { tip.style.visibility = "hidden"; for (const one of drawn) one.svg.querySelector(".now").style.visibility = "hidden"; }
byId("charts").addEventListener("pointerleave", hide);

// ---- parts that do not depend on the choice
function showFixed() {
  const { name, about, handle_collisions } = report.simulator, evaluated = report.scenes.length, sets = report.data.filter((one) => one.scenes).length;
  byId("title").textContent = `Accuracy of ${name} against SPlisHSPlasH${handle_collisions ? "" : ", without collision handling"}`;
  const share = report.scenes.reduce((sum, one) => sum + one.collided_share, 0) / evaluated;
  const collisions = handle_collisions ? `collision handling moved ${(100 * share).toFixed(2)}\u202f% of the particles in a frame` : "collision handling was off";
  byId("subtitle").textContent = `${plural(evaluated, "held-out scene")} of ${plural(sets, "data set")}, simulated from the reference's first frame and compared with the reference solver frame by frame; ${collisions}.`;
  byId("card").hidden = !about;
  byId("about").textContent = about;
  const skipped = report.data.flatMap((one) => one.skipped.map((bad) => ({ ...bad, data: one.name })));
  const notices = skipped.length ? [`${plural(skipped.length, "file")} ${skipped.length === 1 ? "is" : "are"} not valid and listed below.`] : [];
  for (const one of report.data) if (one.scenes && one.floor_missing)
    notices.push(`${one.floors ? `Only ${one.floors} of the ${one.scenes} scenes` : "No scene"} of ${one.name} ${one.floors > 1 ? "have" : "has"} a reproducibility floor: ${one.floor_missing}.`);
  for (const one of report.data) {
    const members = report.scenes.filter((scene) => scene.data === one.name), far = members.filter((scene) => !scene.reached_solid).length;
    if (far) notices.push(`In ${far} of the ${members.length} scenes of ${one.name} no particle came near a solid: Chamfer Surface and Surface Penetration are 0 there and say nothing.`);
  }
  for (const one of report.data) if (one.domain_warning) notices.push(`${one.domain_warning}.`);
  byId("notices").innerHTML = notices.map((text) => `<div class="notice">${escape(text)}</div>`).join("");
  byId("skipped-section").hidden = !skipped.length;
  byId("skipped").innerHTML = skipped.map((bad) => `<li><b>${escape(bad.data)}/${escape(bad.file)}</b>: ${escape(bad.reason)}</li>`).join("");
  byId("videos-section").hidden = !report.videos.length && !report.no_videos;
  byId("videos-note").textContent = report.no_videos || "By Chamfer distance over all frames, of all data sets. Simulator on the left, reference on the right, in real time.";
  byId("videos").innerHTML = report.videos.map((one) => `<figure><video controls muted loop playsinline preload="metadata" src="${one.source}"></video>`
    + `<figcaption><b>${one.rank}</b><span>${escape(one.data)} / ${escape(one.scene)}, ${escape(one.surface)}</span><span>Chamfer ${format(one.chamfer, metric.chamfer)} m</span></figcaption></figure>`).join("");
  for (const video of document.querySelectorAll("video")) { // show the splash until the video plays
    video.addEventListener("loadedmetadata", () => { video.currentTime = Math.min(0.9, video.duration / 2); }, { once: true });
    video.addEventListener("play", () => { video.currentTime = 0; }, { once: true });
  }
  byId("meanings").innerHTML = metrics.map((one) => `<dt>${escape(one.name)} <small>${escape(one.unit)}</small></dt><dd>${escape(one.description)}</dd>`).join("")
    + "<dt>floor</dt><dd>the reproducibility floor: the same metrics for repeats of the reference solver with the water moved by 1 mm along x, y and z; mean of the three</dd>"
    + "<dt>ratio</dt><dd>simulator over floor; at 1 the simulator is indistinguishable from a second run of the reference solver</dd>"
    + `<dt>near the solid</dt><dd>at a signed distance below ${report.near} m</dd>`;
  byId("footer").textContent = `surfsup ${report.version}; a frame is ${1000 * report.frame_time} ms; curves here have a value for every ${report.stride === 1 ? "frame" : `${report.stride} frames`}, report.json has all.`;
  byId("data").innerHTML = report.data.filter((one) => one.scenes).map((one) => `<option>${escape(one.name)}</option>`).join("");
  byId("window").innerHTML = Object.keys(meanOf(chosen.data, "all").windows).reverse().map((name) => `<option value="${name}">${windowName(name)}</option>`).join("");
}
function show() {
  byId("scene").innerHTML = `<option value="">all scenes, mean</option>` + scenesOf(chosen.data).map((one) => `<option value="${escape(one.scene)}">${escape(one.scene)} ${escape(one.surface)}</option>`).join("");
  byId("scene").value = chosen.scene || "";
  for (const place of document.querySelectorAll(".window-name")) place.textContent = `Frames: ${windowName(chosen.window)}.`;
  for (const place of document.querySelectorAll(".data-name")) place.textContent = `Data set: ${chosen.data}.`;
  tiles(); drawCharts(); bySurface(); byTime(); everyScene();
}
byId("data").addEventListener("change", (event) => { chosen.data = event.target.value; chosen.scene = null; show(); });
byId("scene").addEventListener("change", (event) => { chosen.scene = event.target.value || null; show(); });
byId("window").addEventListener("change", (event) => { chosen.window = event.target.value; show(); });
let lastWidth = 0;
new ResizeObserver(() => { const width = byId("charts").clientWidth; if (width !== lastWidth) { lastWidth = width; drawCharts(); } }).observe(byId("charts"));
showFixed();
show();
