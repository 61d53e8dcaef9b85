// The page "Number": one number with two futures, its best denoiser by Bayes' rule, and the paths of the samplers.
import schedules from "live/schedules.json";
import { ddim, ddimIndices, epsOf, gaussian, posteriorMean } from "./sampler.js";

const host = document.querySelector("#live-number"), form = host.querySelector("form"), output = host.querySelector("output");
const canvas = host.querySelector("canvas"), [paths, samples] = host.querySelectorAll("svg");
const CENTRES = [-1, 0.8], WIDTH = 0.15, REACH = 2, SHOWN = 60, BINS = 50; // rad
let seed = 1;

/** Weighted bells at y, noised to alpha_bar a. */
const bells = (y, a, weights) => {
  const variance = a * WIDTH ** 2 + 1 - a;
  return weights.map((w, i) => (w * Math.exp(-((y - Math.sqrt(a) * CENTRES[i]) ** 2) / (2 * variance))) / Math.sqrt(2 * Math.PI * variance));
};
const density = (y, a, weights) => bells(y, a, weights).reduce((p, q) => p + q);

/** E[y0 | y_t]: each bell's guess, as likely as Bayes' rule says. */
function guess(y, a, weights) {
  const variance = a * WIDTH ** 2 + 1 - a, gain = (Math.sqrt(a) * WIDTH ** 2) / variance;
  const away = CENTRES.map((c) => y - Math.sqrt(a) * c), logs = away.map((gap, i) => Math.log(weights[i]) - gap ** 2 / (2 * variance));
  const top = Math.max(...logs), likely = logs.map((log) => Math.exp(log - top)), sum = likely[0] + likely[1];
  return CENTRES.reduce((mean, c, i) => mean + (likely[i] / sum) * (c + gain * away[i]), 0);
}

/** All states of every path, clean ones last, with the share of the way at each. */
async function walked({ schedule, sampler, steps, left }, start, noise) {
  const alphaBar = schedules[schedule], weights = [1 - left, left], M = alphaBar.length, indices = ddimIndices(M, steps, "trailing");
  const denoise = (y, t) => epsOf(y, y.map((value) => guess(value, alphaBar[t], weights)), alphaBar[t]);
  const run = sampler === "ddim" ? ddim : posteriorMean, states = [start];
  for await (const { y } of run(denoise, start, alphaBar, indices, sampler === "ddpm" ? { noise } : {})) states.push(y);
  return { states, ways: [...indices.map((t) => 1 - (t + 1) / M), 1], weights };
}

const up = (y) => 500 - (500 * y) / REACH; // of the pictures' thousand

function haze(schedule, weights) { // the true density, noise on the left
  const wide = 200, high = 150, context = Object.assign(canvas, { width: wide, height: high }).getContext("2d"), image = context.createImageData(wide, high);
  const alphaBar = schedules[schedule];
  for (let i = 0; i < wide; i++)
    for (let j = 0; j < high; j++) {
      const a = alphaBar[Math.round((1 - i / (wide - 1)) * (alphaBar.length - 1))], y = REACH * (1 - (2 * (j + 0.5)) / high);
      image.data.set([0, 114, 178, 230 * Math.min(density(y, a, weights), 1)], 4 * (j * wide + i));
    }
  context.putImageData(image, 0, 0);
}

async function draw() {
  const of = (name, low, high) => Math.min(Math.max(Number(form.elements[name].value) || low, low), high);
  const asked = { schedule: form.elements.schedule.value, sampler: form.elements.sampler.value, steps: Math.round(of("steps", 1, 1000)), left: of("left", 0.05, 0.95) };
  const count = Math.round(of("paths", 10, 2000)), fresh = gaussian(seed, count), noise = () => Float64Array.from(fresh());
  const { states, ways, weights } = await walked(asked, noise(), noise);
  haze(asked.schedule, weights);
  const route = (s) => `<polyline class="path" points="${states.map((y, i) => `${(1000 * ways[i]).toFixed(1)},${up(y[s]).toFixed(1)}`).join(" ")}"/>`;
  paths.innerHTML = Array.from({ length: Math.min(SHOWN, count) }, (_, s) => route(s)).join("");
  const end = states.at(-1), bin = (2 * REACH) / BINS, bars = Array(BINS).fill(0);
  end.forEach((y) => bars[Math.min(Math.max(Math.floor((y + REACH) / bin), 0), BINS - 1)]++);
  const scale = 90 / Math.max(density(CENTRES[0], 1, weights), density(CENTRES[1], 1, weights)), high = 1000 / BINS;
  const truth = Array.from({ length: 201 }, (_, i) => -REACH + (2 * REACH * i) / 200);
  samples.innerHTML = bars.map((n, i) => `<rect class="bar" x="0" y="${1000 - (i + 1) * high}" width="${Math.min((scale * n) / (count * bin), 100)}" height="${0.85 * high}"/>`).join("")
    + `<polyline class="rebuilt" points="${truth.map((y) => `${scale * density(y, 1, weights)},${up(y)}`).join(" ")}"/>`;
  const share = (test) => `${((100 * end.filter(test).length) / count).toFixed(1)} %`;
  output.value = `${count} numbers: ${share((y) => y > 0.4)} turn left, ${share((y) => y < -0.4)} right, ${share((y) => Math.abs(y) <= 0.4)} walk into the corner. Of the true ones ${(100 * asked.left).toFixed(0)} % turn left and almost none walks into the corner.`;
  paths.setAttribute("aria-label", `Paths of ${Math.min(SHOWN, count)} numbers from noise to a turn. ${output.value}`);
  samples.setAttribute("aria-label", `Histogram of the samples. ${output.value}`);
}

form.elements.schedule.replaceChildren(...Object.keys(schedules).map((name) => new Option(name, name, false, name === "cosine")));
form.addEventListener("input", draw);
form.addEventListener("submit", (event) => (event.preventDefault(), seed++, draw()));
draw();
host.live = { walked };
