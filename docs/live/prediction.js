// Prediction: observed frames to a condition, coefficients to futures. The mathematics of mwlib/prediction/representation.py and
// continuation.py with the matrices that `mwlib export-onnx` writes. Motions are flat: frame after frame, C numbers each.

/** Product of a matrix, given by its rows, and of a flat one of C columns. */
function times(rows, flat, C) {
  const out = new Float64Array(rows.length * C);
  rows.forEach((row, i) => row.forEach((value, k) => {
    if (value) for (let c = 0; c < C; c++) out[i * C + c] += value * flat[k * C + c];
  }));
  return out;
}

export class Prediction {
  constructor(about) {
    const { joints, parents, left, right } = about.skeleton;
    Object.assign(this, about, { C: 3 * (joints.length - 1), axes: about.up === "z" ? [0, 1] : [0, 2] });
    if (!about.matrices || !["pose", "displacement"].includes(about.relative) || about.sampling.decoding !== "continued")
      throw new Error("this page runs models whose transform is one matrix along time, and whose futures continue the history");
    const depth = (joint) => (parents[joint] < 0 ? 0 : 1 + depth(parents[joint]));
    this.hips = left.map((joint, i) => [joint, right[i]]).reduce((best, next) => (depth(next[0]) < depth(best[0]) ? next : best));
  }
  /** The last observed pose. */
  last(history) {
    return history.slice((this.history - 1) * this.C, this.history * this.C);
  }
  /** The angle of the line from the right hip to the left one, seen from above. */
  heading(pose) {
    const [a, b] = this.axes.map((axis) => pose[3 * (this.hips[0] - 1) + axis] - pose[3 * (this.hips[1] - 1) + axis]);
    return Math.atan2(b, a);
  }
  /** Motions turned about the up-axis. */
  turned(x, angle) {
    const out = Float64Array.from(x), [a, b] = this.axes, cos = Math.cos(angle), sin = Math.sin(angle);
    for (let i = 0; i < x.length; i += 3) {
      out[i + a] = cos * x[i + a] - sin * x[i + b];
      out[i + b] = sin * x[i + a] + cos * x[i + b];
    }
    return out;
  }
  seen(history) { // as the model looks at it, and the angle by which it was turned
    const angle = this.facing ? this.heading(this.last(history)) : 0;
    return { angle, x: this.turned(history.slice(0, this.history * this.C), -angle) };
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
      return this.withBones(this.turned(future, angle), this.last(history));
    });
  }
  /** Poses with bones as long as in the last observed one, built from the root outwards. */
  withBones(x, pose) {
    if (this.sampling.bones === "free") return x;
    const { parents } = this.skeleton, C = this.C, out = new Float64Array(x.length);
    const bone = (from, at, joint) => [0, 1, 2].map((k) => from[at + 3 * (joint - 1) + k] - (parents[joint] ? from[at + 3 * (parents[joint] - 1) + k] : 0));
    const lengths = parents.map((_, joint) => (joint ? Math.hypot(...bone(pose, 0, joint)) : 0));
    const order = parents.map((_, joint) => joint).slice(1); // parents stand before their children
    for (let at = 0; at < x.length; at += C)
      for (const joint of order) {
        const drawn = bone(x, at, joint), factor = lengths[joint] / Math.max(Math.hypot(...drawn), 1e-6), up = parents[joint];
        for (let k = 0; k < 3; k++) out[at + 3 * (joint - 1) + k] = (up ? out[at + 3 * (up - 1) + k] : 0) + factor * drawn[k];
      }
    return out;
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
