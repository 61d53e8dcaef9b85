// Prediction: observed frames to a condition, coefficients to futures. The mathematics of mwlib/prediction/representation.py with
// the matrices that `mwlib export-onnx` writes. Motions are flat: frame after frame, C numbers each.

import { headingOf, hipsOf, times, turned, withBones } from "./bodies.js";

export class Prediction {
  constructor(about) {
    const axes = about.up === "z" ? [0, 1] : [0, 2];
    Object.assign(this, about, { C: 3 * (about.skeleton.joints.length - 1), axes, hips: hipsOf(about.skeleton) });
    if (!about.matrices || !["pose", "displacement"].includes(about.relative) || about.sampling.decoding !== "continued")
      throw new Error("this page runs models whose transform is one matrix along time, and whose futures continue the history");
  }
  /** The last observed pose. */
  last(history) {
    return history.slice((this.history - 1) * this.C, this.history * this.C);
  }
  seen(history) { // as the model looks at it, and the angle by which it was turned
    const angle = this.facing ? headingOf(this.last(history), this.hips, this.axes) : 0;
    return { angle, x: turned(history.slice(0, this.history * this.C), -angle, this.axes) };
  }
  held(pose) { // in every frame of the window
    return Float64Array.from({ length: this.frames * this.C }, (_, i) => pose[i % this.C]);
  }
  /** Coefficients (rows, columns) of the history, its last pose held over the future. */
  condition(history) {
    const { x } = this.seen(history), padded = this.held(this.last(x));
    padded.set(x);
    const { condition_mean, condition_deviation } = this.scales, mean = condition_mean.flat(), deviation = condition_deviation.flat();
    return Float32Array.from(times(this.matrices.analysis, padded, this.C), (c, i) => (c - mean[i]) / deviation[i]);
  }
  /** Futures of sampled coefficients, metres: the smoothest motions that have them and continue the history. */
  futures(y, history) {
    const { angle, x } = this.seen(history), { analysis, of_coefficients, of_history } = this.matrices;
    const mean = this.scales.mean.flat(), deviation = this.scales.deviation.flat(), size = mean.length;
    const origin = this.relative === "pose" ? new Float64Array(size) : times(analysis, this.held(this.last(x)), this.C);
    const onward = times(of_history, x, this.C);
    return Array.from({ length: y.length / size }, (_, s) => {
      const c = origin.map((at, i) => at + mean[i] + y[s * size + i] * deviation[i]);
      const future = times(of_coefficients, c, this.C).map((value, i) => value + onward[i]);
      const placed = turned(future, angle, this.axes);
      return this.sampling.bones === "free" ? placed : withBones(placed, this.last(history), this.skeleton.parents);
    });
  }
}

/** Mean distance of a future from the truth, metres over the C numbers of a frame: the ADE of one sample. */
export function distance(future, truth, C) {
  let sum = 0;
  for (let at = 0; at < truth.length; at += C) {
    let square = 0;
    for (let c = at; c < at + C; c++) square += (future[c] - truth[c]) ** 2;
    sum += Math.sqrt(square);
  }
  return (sum * C) / truth.length;
}
