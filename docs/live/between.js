// The page "Between": a model of in-betweening in the browser.
import clips from "live/clips.json";
import players from "live/players.json";
import { metres } from "./bodies.js";
import { Inbetweening, jointsOf, seenFrom } from "./inbetweening.js";
import { about, Network } from "./network.js";
import { ddim, ddimIndices, gaussian } from "./sampler.js";
import { floorOf, standing } from "./standing.js";
import { megabytes, place, show, values, whenAsked } from "./stage.js";

const host = document.querySelector("#live-between"), form = host.querySelector("form"), output = host.querySelector("output");
const { from, to, start, end, gap, turn } = form.elements, svg = host.querySelector(".plan");
const C = 3 * players.prediction.bodies[0].parents.length, FASTEST = 12, FPS = clips.fps; // metres per second, as mwlib refuses
const states = clips.clips.map(({ data }) => metres(data).map((value, i, all) => (i % C < 3 ? value : value - all[i - (i % C) + (i % 3)])));
const geometry = new Inbetweening({ ...clips.body, mean: Array(C).fill(0) });
let model, network, seed = 0, at = [1, 0]; // where the last pose stands: metres ahead of the first, and to its left
let wanted = false, busy = false, drawn;

const frames = (clip, moment) => [-1, 0, 1].map((more) => states[clip].slice((moment + more) * C, (moment + more + 1) * C));
const own = (state) => [state.slice(0, 2), geometry.heading(state)];
const radians = (degrees) => (degrees * Math.PI) / 180;

/** The four given states, seen from the first keyframe: it stands at the origin, its left along x, and looks along -y. */
function given() {
  const [before, first] = frames(Number(from.value), Number(start.value)), [, last, after] = frames(Number(to.value), Number(end.value));
  const here = (state) => seenFrom(state, ...own(first)), angle = radians(Number(turn.value)), [ahead, left] = at;
  const there = (state) => seenFrom(seenFrom(state, ...own(last)), [0, 0], -angle).map((value, i) => value + (i === 0 ? left : i === 1 ? -ahead : 0));
  return [here(before), here(first), there(last), there(after)];
}

/** Where a pose of the same clip, later, stands; any other keeps its place. */
function asInClip() {
  if (!isLater()) return;
  const [, first] = frames(Number(from.value), Number(start.value)), [, last] = frames(Number(to.value), Number(end.value));
  const seen = seenFrom(last, ...own(first));
  at = [-seen[1], seen[0]];
  turn.value = (geometry.heading(seen) * 180) / Math.PI;
  gap.value = end.value - start.value - 1;
}
const isLater = () => from.value === to.value && end.value - start.value > Number(gap.min);

/** What the clip has between the poses, if they stand as there. */
function truth(T) {
  if (!isLater() || end.value - start.value !== T - 1) return undefined;
  const [, first] = frames(Number(from.value), Number(start.value)), [, , last] = given();
  const x = Array.from({ length: T }, (_, k) => seenFrom(frames(Number(from.value), Number(start.value) + k)[1], ...own(first)));
  return Math.max(...x.at(-1).map((value, i) => Math.abs(value - last[i]))) < 0.15 ? Float64Array.from(x.flatMap((one) => [...one])) : undefined;
}

async function open(told = () => {}) {
  let bytes = 0;
  const heard = (count) => told(0, `Loading: ${megabytes((bytes += count))}`);
  model ??= new Inbetweening(await about(place, "inbetween", heard));
  network ??= await Network.open(place, "inbetween", heard);
}

/** Motions (T, C) of four given states: as sampled, and their joints with feet that stand; and the seconds that the draw took. */
async function sample(four, T, { samples, temperature, steps }, noise, told = () => {}) {
  await open(told);
  const began = performance.now(), window = model.gap(four, T), shape = [window.tf.length, C], { alpha_bar: alphaBar, sampling } = model;
  const condition = { condition: ["float32", window.condition, [1, shape[0], window.condition.length / shape[0]]], ends: ["float32", window.ends, [1, window.ends.length]] };
  const denoise = network.denoiser(model, shape, condition, 1);
  const said = { mean: await network.said("mean", shape, condition), factor: await network.said("factor", shape, condition) };
  const one = shape[0] * C, noises = (noise ?? gaussian(seed, samples * one))(), first = new Float64Array((samples + 1) * one); // the last of zeros
  first.set(noises.map((value) => temperature * value));
  let last, count = 0;
  const indices = ddimIndices(alphaBar.length, steps ?? sampling.steps, sampling.spacing);
  for await (last of ddim(denoise, first, alphaBar, indices)) told(++count / indices.length);
  const silent = last.y.subarray(samples * one), centred = last.y.slice(0, samples * one).map((value, i) => value - silent[i % one]);
  const motions = model.motions(sampling.centred ? centred : last.y.subarray(0, samples * one), said, window), floor = floorOf(four.map((state) => jointsOf(state, C)), model.skeleton);
  const joints = motions.map((motion) => standing(jointsOf(motion, C), floor, model.skeleton, model.fps));
  return { motions, joints, seconds: (performance.now() - began) / 1000 };
}

const mean = (x) => x.reduce((sum, value) => sum + value, 0) / x.length;
const apart = (x, y) => mean(Array.from({ length: x.length / 3 }, (_, i) => Math.hypot(x[3 * i] - y[3 * i], x[3 * i + 1] - y[3 * i + 1], x[3 * i + 2] - y[3 * i + 2])));

/** Draw the motions of what the form says. */
async function fill(told) {
  const asked = values(form), T = asked.gap + 2, four = given(), [first, last] = [four[1], four[2]];
  const speed = (Math.hypot(...[0, 1, 2].map((k) => last[k] - first[k])) * FPS) / (T - 1);
  if (speed > FASTEST) throw new Error(`this way needs ${speed.toFixed(0)} m/s, and nobody is faster than ${FASTEST}: bring the poses nearer, or give more frames`);
  const { joints, seconds } = await sample(four, T, asked, undefined, told), real = truth(T);
  drawn = joints;
  stage(four, joints, real && jointsOf(real, C));
  const said = real ? ` Beside the truth: ${(100 * mean(joints.map((one) => apart(one, jointsOf(real, C))))).toFixed(1)} cm on average.` : "";
  output.value = `${joints.length} motions of ${((T - 1) / FPS).toFixed(2)} s in ${seconds.toFixed(2)} s ${network.where} (noise ${seed}).${said}`;
}

function stage(four, motions, real) {
  const poses = [four[1], four[2]].map((state) => jointsOf(state, C)), T = motions ? motions[0].length / C : 1;
  const made = (positions, i) => (motions ? { name: `motion ${i + 1}`, kind: "predicted", start: 0, positions } : { name: ["first pose", "last pose"][i], kind: i ? "predicted" : "observed", start: 0, positions });
  const bodies = (motions ?? poses).map(made);
  if (real) bodies.push({ name: "truth", kind: "truth", start: 0, positions: real });
  const ghosts = (motions ? poses : []).map((positions, i) => ({ positions, start: 0, frame: i ? T - 1 : 0, of: bodies.map((_, n) => n) }));
  const alt = `3-D player of ${motions?.length ?? 0} motions from one pose to another, ${((T - 1) / FPS).toFixed(2)} s.`;
  show(host.querySelector(".stage"), players.prediction, bodies, { alt, frames: T, fps: FPS, history: 0, azimuth: -145, follow: false, goesOn: motions !== undefined, keyframes: T > 1 ? [0, T - 1] : [], ghosts });
}

const make = (kind, attributes) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  return node;
};
const WAY = [600, 180, 25]; // centimetres: ahead, to the sides, of a mark's line
function plan() {
  const [x, y] = [100 * at[0], -100 * at[1]], angle = radians(Number(turn.value));
  const grid = Array.from({ length: 17 }, (_, i) => make("line", { class: "axis", x1: 50 * i - 200, x2: 50 * i - 200, y1: -180, y2: 180 }));
  const across = Array.from({ length: 7 }, (_, i) => make("line", { class: "axis", x1: -200, x2: 600, y1: 50 * i - 150, y2: 50 * i - 150 }));
  const ways = (drawn ?? []).map((one) => make("polyline", { class: "path", points: Array.from({ length: one.length / C }, (_, t) => `${-100 * one[t * C + 1]},${-100 * one[t * C]}`).join(" ") }));
  const look = (cx, cy, turned) => make("line", { class: "drawn", x1: cx, y1: cy, x2: cx + 2 * WAY[2] * Math.cos(turned), y2: cy - 2 * WAY[2] * Math.sin(turned) });
  svg.replaceChildren(...grid, ...across, ...ways, look(0, 0, 0), make("circle", { class: "drawn", r: 12 }), look(x, y, angle), make("circle", { class: "at", cx: x, cy: y, r: 15 }));
  const side = Math.abs(at[1]) < 0.05 ? "" : `, ${Math.abs(at[1]).toFixed(1)} m to the ${at[1] > 0 ? "left" : "right"}`;
  svg.setAttribute("aria-description", `The last pose stands ${at[0].toFixed(1)} m ahead${side}, turned by ${turn.value} degrees.`);
  for (const [field, text] of [[start, moment(start)], [end, moment(end)], [gap, `${gap.value} frames, ${((Number(gap.value) + 1) / FPS).toFixed(2)} seconds`], [turn, `${turn.value} degrees`]]) field.setAttribute("aria-valuetext", text), (field.title = text);
}
const moment = (field) => `${(field.value / FPS).toFixed(2)} seconds into the clip`;
const bounded = (value, most, least = -most) => Math.min(Math.max(value, least), most);
function put(ahead, left) {
  at = [bounded(ahead, (WAY[0] - 20) / 100, -1.8), bounded(left, (WAY[1] - 20) / 100)];
  moved();
}

/** Something was moved: the motion follows, if the model is there; of several moves the last one counts. */
async function moved() {
  plan();
  wanted = true;
  if (busy) return;
  if (!network) return stage(given());
  busy = true;
  while (wanted) {
    wanted = false;
    output.classList.remove("warned");
    try {
      await fill();
    } catch (error) {
      output.classList.add("warned"), (output.value = `That did not work: ${error.message}.`);
    }
    plan();
    await new Promise(requestAnimationFrame); // the page may paint
  }
  busy = false;
}

const pointed = (event) => {
  const point = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
  put(point.x / 100, -point.y / 100);
};
svg.addEventListener("pointerdown", (event) => (svg.setPointerCapture(event.pointerId), pointed(event)));
svg.addEventListener("pointermove", (event) => svg.hasPointerCapture(event.pointerId) && pointed(event));
svg.addEventListener("keydown", (event) => {
  const [ahead, left, angle] = { ArrowRight: [0.1, 0, 0], ArrowLeft: [-0.1, 0, 0], ArrowUp: [0, 0.1, 0], ArrowDown: [0, -0.1, 0], PageUp: [0, 0, 15], PageDown: [0, 0, -15] }[event.key] ?? [];
  if (ahead === undefined) return;
  event.preventDefault(), event.stopPropagation(); // else arrows turn the site's pages
  turn.value = ((Number(turn.value) + angle + 540) % 360) - 180;
  put(at[0] + ahead, at[1] + left);
});
form.addEventListener("input", ({ target }) => {
  const chosen = { [from.name]: [from, start], [to.name]: [to, end] }[target.name];
  if (chosen) ranged(...chosen);
  if ([from, to].includes(target) && from.value !== to.value) (at = [1, 0]), (turn.value = 0);
  if ([from, to, start, end].includes(target)) asInClip();
  moved();
});
const ranged = (clip, field) => Object.assign(field, { min: 1, max: states[Number(clip.value)].length / C - 2 });
for (const field of [from, to]) field.replaceChildren(...clips.clips.map(({ clip, action }, i) => new Option(`${action} (${clip})`.replaceAll("_", " "), i)));
ranged(from, start), ranged(to, end);
(start.value = 40), (end.value = 80);
host.querySelector(".owners").textContent = clips.acknowledgement;
whenAsked(host, output, async (told) => {
  seed++;
  await fill(told);
  plan();
  form.querySelector("button").textContent = "New noise";
});
asInClip();
moved();
host.live = { sample, given, open };
