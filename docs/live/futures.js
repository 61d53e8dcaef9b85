// The page "Futures": a model of prediction in the browser.
import people from "live/people.json";
import players from "live/players.json";
import { metres } from "./bodies.js";
import { about, Network } from "./network.js";
import { distance, Prediction } from "./prediction.js";
import { ddim, ddimIndices, gaussian } from "./sampler.js";
import { megabytes, place, show, values, whenAsked } from "./stage.js";

const host = document.querySelector("#live-futures"), form = host.querySelector("form"), output = host.querySelector("output");
const opened = {}; // model -> its network and mathematics
const J = players.prediction.bodies[0].parents.length, C = 3 * (J - 1);
let seed = 0, current;

const chosen = () => {
  const set = people[Number(form.elements.people.value)], window = set.windows[Number(form.elements.window.value)];
  return { ...set, ...window, x: metres(window.data) };
};

/** Everything for one model; the page loads it when it is first asked for. */
async function open(name, told = () => {}) {
  if (current === name) return opened[name];
  let bytes = 0;
  const heard = (count) => told(0, `Loading: ${megabytes((bytes += count))}`);
  const model = opened[name]?.model ?? new Prediction(await about(place, name, heard));
  current = undefined;
  opened[name] = { model, network: await Network.open(place, name, heard) };
  current = name;
  return opened[name];
}

/** Futures of a window: flat (F, C) arrays in metres, their errors, and the seconds that the draw took. */
async function sample({ model: name, x, history }, { samples, steps, guidance, temperature }, noise, told = () => {}) {
  const { model, network } = await open(name, told), seen = x.slice(0, history * C), truth = x.slice(history * C);
  const began = performance.now(), [rows, columns] = model.shape, { alpha_bar: alphaBar, sampling } = model;
  const condition = { condition: ["float32", model.condition(seen), [1, rows, columns]] };
  const denoise = network.denoiser(model, model.shape, condition, guidance, sampling.form);
  // double precision: where sampling begins, 1 / sqrt(alpha_bar) multiplies rounding by thousands
  const one = rows * columns, noises = (noise ?? gaussian(seed, samples * one))();
  const start = Float64Array.from(noises, (value, i) => temperature * sampling.spread[Math.floor(i / one)] * value);
  let last, count = 0;
  for await (last of ddim(denoise, start, alphaBar, ddimIndices(alphaBar.length, steps, sampling.spacing))) told(++count / steps);
  const futures = model.futures(last.y, seen);
  return { futures, errors: futures.map((future) => distance(future, truth, C)), seconds: (performance.now() - began) / 1000 };
}

/** Put the root, which the model does not know, at the origin, and the lowest joints of the truth on the floor. */
function rooted(x, floor) {
  const frames = x.length / C, out = new Float64Array(frames * J * 3).fill(0);
  for (let f = 0; f < frames; f++) out.set(x.subarray(f * C, (f + 1) * C), 3 * (f * J + 1));
  return out.map((value, i) => (i % 3 === 2 ? value - floor : value));
}

function stage(window, futures = []) {
  const heights = window.x.filter((_, i) => i % 3 === 2).sort(), floor = heights[Math.floor(heights.length / 100)];
  const bodies = [{ name: "truth", kind: "truth", start: 0, positions: rooted(window.x, floor) }];
  futures.forEach((future, i) => bodies.push({ name: futures.length > 6 ? "" : `future ${i + 1}`, kind: "predicted", start: window.history, positions: rooted(future, floor) }));
  bodies[0].name = futures.length > 6 ? `truth, and ${futures.length} futures` : "truth";
  const alt = `3-D player: ${window.action}, half a second observed, then the truth${futures.length ? ` and ${futures.length} futures` : ""}.`;
  const frames = window.x.length / C;
  show(host.querySelector(".stage"), players.prediction, bodies, { alt, frames, history: window.history, azimuth: window.azimuth });
}

function offer() { // the windows of the chosen people
  const set = people[Number(form.elements.people.value)];
  form.elements.window.replaceChildren(...set.windows.map(({ action, clip }, i) => new Option(`${action} (${clip})`.replaceAll("_", " "), i)));
  host.querySelector(".owners").textContent = set.acknowledgement;
  form.elements.temperature.value = set.temperature;
  stage(chosen());
}

form.elements.people.addEventListener("change", offer);
form.elements.window.addEventListener("change", () => stage(chosen()));
whenAsked(host, output, async (told) => {
  seed++;
  const window = chosen(), asked = values(form), found = await sample(window, asked, undefined, told);
  const truth = window.x.slice(window.history * C), last = window.x.slice((window.history - 1) * C, window.history * C);
  const still = distance(truth.map((_, i) => last[i % C]), truth, C), best = Math.min(...found.errors);
  stage(window, found.futures);
  output.value = `${asked.samples} futures in ${found.seconds.toFixed(2)} s ${opened[current].network.where} (noise ${seed}). Error of the best: ${best.toFixed(2)} m; of standing still: ${still.toFixed(2)} m; of a future on average: ${(found.errors.reduce((x, y) => x + y) / found.errors.length).toFixed(2)} m.`;
  form.querySelector("button").textContent = "New noise";
});
offer();
host.live = { sample, chosen, open }; // for whoever asks at the console
