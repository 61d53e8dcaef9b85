// In-betweening: keyframes to a condition, tokens to motions. The mathematics of mwlib/inbetweening/representation.py, windows.py
// and bridge.py with what `mwlib export-onnx` writes. States are flat: the root's place, then the other joints from the root, z up.
import { headingOf, hipsOf, times, turned, withBones } from "./bodies.js";

/** A state seen from a place on the floor and a heading. */
export const seenFrom = (state, [x, y], angle) => turned(state.map((value, i) => value - (i === 0 ? x : i === 1 ? y : 0)), -angle);

/** Rows of the orthonormal sines of T frames, which are zero at both ends. */
const sines = (rows, T) => Array.from({ length: Math.min(rows, T - 2) }, (_, k) =>
  Float64Array.from({ length: T }, (_, i) => (i % (T - 1) ? Math.sqrt(2 / (T - 1)) * Math.sin((Math.PI * (k + 1) * i) / (T - 1)) : 0)));
const transposed = (rows) => Array.from(rows[0], (_, i) => rows.map((row) => row[i]));

export class Inbetweening {
  constructor(about) {
    Object.assign(this, about, { C: about.mean.length, hips: hipsOf(about.skeleton) });
  }
  heading(state) {
    return headingOf(state.slice(3), this.hips);
  }
  /** A gap of T frames, keyframes among them, that is given both and the frames beyond them: states in the world. */
  gap(given, T) {
    const { C, mean, deviation, velocity } = this, angle = this.heading(given[1]), origin = given[1].slice(0, 2), last = T - 1;
    const [before, first, final, after] = given.map((state) => seenFrom(state, origin, angle)), tf = sines(this.rows, T);
    const coast = (k) => k * Math.exp(-((k / this.coast) ** 2)) * (1 - k / last) ** 2;
    const line = new Float64Array(T * C), room = Float64Array.from({ length: T }, (_, k) => Math.max(Math.sin((Math.PI * k) / last) / 2, this.least_room));
    for (let k = 0; k < T; k++)
      for (let c = 0; c < C; c++) {
        const step = (final[c] - first[c]) / last;
        line[k * C + c] = first[c] + step * k + (first[c] - before[c] - step) * coast(k) + (final[c] - after[c] + step) * coast(last - k);
      }
    const normal = line.map((value, i) => (value - mean[i % C]) / deviation[i % C]), seen = times(tf, normal, C);
    const steps = [first.map((value, c) => value - before[c]), after.map((value, c) => value - final[c])];
    const beyond = [...steps.flatMap((step) => [...step.map((value, c) => value / velocity[c])]), 1, 1]; // both are known
    const condition = tf.flatMap((_, k) => [...seen.subarray(k * C, (k + 1) * C), 0, k / T, T / this.frames, ...beyond]);
    const ends = [...normal.subarray(0, C), ...normal.subarray(last * C), ...beyond, Math.log(T)];
    return { given, T, tf, line, room, first, angle, origin, condition: Float32Array.from(condition), ends: Float32Array.from(ends) };
  }
  /** Motions (T, C) in the world of sampled tokens, their mean and their size; the keyframes are at both ends. */
  motions(y, { mean, factor }, { given, T, tf, line, room, first, angle, origin }) {
    const { C, axes, skeleton } = this, size = tf.length * C, usual = this.power.at(T - this.frames - 1).flat(), back = transposed(tf);
    return Array.from({ length: y.length / size }, (_, s) => {
      const z = times(back, usual.slice(0, size).map((value, i) => (y[s * size + i] * factor[Math.floor(i / C)] + mean[i]) * value), C);
      const x = times(axes, transposed(Array.from({ length: T }, (_, t) => z.subarray(t * C, (t + 1) * C))).flatMap((row) => [...row]), T); // (C, T)
      const state = (t) => Float64Array.from({ length: C }, (_, c) => x[c * T + t] * room[t] + line[t * C + c]);
      const out = new Float64Array(T * C);
      for (let t = 0; t < T; t++) {
        const free = state(t), sized = Float64Array.of(...free.slice(0, 3), ...withBones(free.slice(3), first.slice(3), skeleton.parents));
        out.set(seenFrom(turned(sized, angle), [-origin[0], -origin[1]], 0), t * C);
      }
      out.set(given[1], 0), out.set(given[2], (T - 1) * C);
      return out;
    });
  }
}

/** Joints (T, J, 3) of states. */
export const jointsOf = (states, C) => states.map((value, i) => (i % C < 3 ? value : value + states[i - (i % C) + (i % 3)]));
