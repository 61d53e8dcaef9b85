// The page "Sentences": a model of text to motion in the browser.
import players from "live/players.json";
import { fusedJoints, steadyBones } from "./features.js";
import { about, Network } from "./network.js";
import { numbersOf, Reader, wordsOf } from "./reading.js";
import { ddimIndices, gaussian, posteriorMean } from "./sampler.js";
import { megabytes, place, show, values, whenAsked } from "./stage.js";

const host = document.querySelector("#live-sentences"), form = host.querySelector("form");
const read = host.querySelector("#live-read"), output = host.querySelector(".told");
let network, seed = 0, model, reader, chosen = false; // chosen: somebody has set the seconds

/** The tables come first, as they are small: words are marked before the network is there. */
async function tables() {
  model ??= await about(place, "sentences");
  reader ??= new Reader(model.typed);
  return { model, reader };
}

/** Mark the words that the model does not know, and say how it reads the sentence. */
async function mark() {
  await tables();
  read.classList.remove("warned");
  try {
    const { text, actions, isLearnt } = reader.read(form.elements.text.value), words = wordsOf(text);
    if (!words.some((word) => reader.known.has(word))) throw new Error("the model knows no word of this");
    const parts = words.flatMap((word) => {
      const part = reader.known.has(word) ? new Text(word) : Object.assign(document.createElement("mark"), { textContent: word, title: "unknown to the model" });
      return [part, " "];
    });
    const usual = reader.time(text);
    if (usual && !chosen) form.elements.seconds.value = usual;
    const unknown = words.filter((word) => !reader.known.has(word)), asks = actions.join(" and then ").replaceAll("_", " ") || "no action";
    read.replaceChildren("It is read as: ", ...parts, `— ${isLearnt ? asks : `${asks}, which the model has not learnt`}${unknown.length ? `; unknown: ${unknown.join(", ")}` : ""}.`);
    return text;
  } catch (error) {
    read.classList.add("warned");
    read.textContent = `${error.message}.`;
    return undefined;
  }
}

/** Raw features (T, D) of each motion, their joints with y up, and the seconds that the draw took. */
async function sample(text, { samples, seconds, steps, guidance }, noise, told = () => {}) {
  await tables();
  let bytes = 0;
  network ??= await Network.open(place, "sentences", (count) => told(0, `Loading: ${megabytes((bytes += count))}`));
  const began = performance.now(), D = model.mean.length, [shortest, longest] = model.lengths;
  const T = Math.min(Math.max(4 * Math.round((seconds * model.fps) / 4), shortest), longest), alphaBar = model.alpha_bar;
  const words = { words: ["int64", BigInt64Array.from(numbersOf(text, model.words), BigInt), [1, numbersOf(text, model.words).length]] };
  const draw = noise ?? gaussian(seed, samples * T * D);
  const denoise = network.denoiser({ ...model, prediction: "y0" }, [T, D], words, guidance, "alg1");
  let last, count = 0;
  for await (last of posteriorMean(denoise, draw(), alphaBar, ddimIndices(alphaBar.length, steps, "trailing"), { noise: draw })) told(++count / steps);
  const raw = last.y.map((value, i) => value * model.deviation[i % D] + model.mean[i % D]);
  const features = Array.from({ length: samples }, (_, s) => raw.subarray(s * T * D, (s + 1) * T * D));
  return { features, joints: features.map((one) => steadyBones(fusedJoints(one, model), model.skeleton.parents)), seconds: (performance.now() - began) / 1000, frames: T };
}

const upright = (y) => y.map((_, i) => (i % 3 === 0 ? y[i] : i % 3 === 1 ? -y[i + 1] : y[i - 1])); // y up -> z up

form.elements.text.addEventListener("input", mark);
form.elements.seconds.addEventListener("input", () => (chosen = true));
whenAsked(host, output, async (told) => {
  const text = await mark();
  if (text === undefined) throw new Error("the sentence cannot be read");
  seed++;
  const asked = values(form), { joints, seconds, frames } = await sample(text, asked, undefined, told);
  const bodies = joints.map((one, i) => ({ name: `motion ${i + 1}`, kind: "predicted", start: 0, positions: upright(one) }));
  const wanders = bodies.some(({ positions }) => Math.hypot(positions.at(-66) - positions[0], positions.at(-65) - positions[1]) > 2.5);
  show(host.querySelector(".stage"), players.sentences, bodies, { alt: `3-D player of ${bodies.length} motions: ${form.elements.text.value}`, frames, history: 0, layout: "side", follow: wanders });
  output.value = `${bodies.length} motions of ${(frames / model.fps).toFixed(1)} s in ${seconds.toFixed(2)} s ${network.where} (noise ${seed}).`;
});
if (location.protocol !== "file:") mark();
host.live = { sample, tables };
