// Poses as flat arrays: joints without the root, x y z of each, frame after frame. As in mwlib/body/kinematics.py.

/** Product of a matrix, given by its rows, and of a flat one of C columns. */
export function times(rows, flat, C) {
  const out = new Float64Array(rows.length * C);
  rows.forEach((row, i) => row.forEach((value, k) => {
    if (value) for (let c = 0; c < C; c++) out[i * C + c] += value * flat[k * C + c];
  }));
  return out;
}

/** The pair of sides nearest the root. */
export function hipsOf({ parents, left, right }) {
  const depth = (joint) => (parents[joint] < 0 ? 0 : 1 + depth(parents[joint]));
  return left.map((joint, i) => [joint, right[i]]).reduce((best, next) => (depth(next[0]) < depth(best[0]) ? next : best));
}

/** The angle of the line from the right hip to the left one, seen from above; axes are the horizontal ones. */
export function headingOf(pose, hips, axes = [0, 1]) {
  const [a, b] = axes.map((axis) => pose[3 * (hips[0] - 1) + axis] - pose[3 * (hips[1] - 1) + axis]);
  return Math.atan2(b, a);
}

/** Points turned about the up-axis. */
export function turned(x, angle, [a, b] = [0, 1]) {
  const out = Float64Array.from(x), cos = Math.cos(angle), sin = Math.sin(angle);
  for (let i = 0; i < x.length; i += 3) {
    out[i + a] = cos * x[i + a] - sin * x[i + b];
    out[i + b] = sin * x[i + a] + cos * x[i + b];
  }
  return out;
}

/** Poses with bones as long as in another one, built from the root outwards; parents stand before their children. */
export function withBones(x, pose, parents) {
  const C = 3 * (parents.length - 1), out = new Float64Array(x.length), order = parents.map((_, joint) => joint).slice(1);
  const bone = (from, at, joint) => [0, 1, 2].map((k) => from[at + 3 * (joint - 1) + k] - (parents[joint] ? from[at + 3 * (parents[joint] - 1) + k] : 0));
  const lengths = parents.map((_, joint) => (joint ? Math.hypot(...bone(pose, 0, joint)) : 0));
  for (let at = 0; at < x.length; at += C)
    for (const joint of order) {
      const drawn = bone(x, at, joint), factor = lengths[joint] / Math.max(Math.hypot(...drawn), 1e-6), up = parents[joint];
      for (let k = 0; k < 3; k++) out[at + 3 * (joint - 1) + k] = (up ? out[at + 3 * (up - 1) + k] : 0) + factor * drawn[k];
    }
  return out;
}

/** Metres of base64 of little-endian int16, millimetres. */
export function metres(text) {
  const bytes = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
  return Float64Array.from(new Int16Array(bytes.buffer), (value) => value / 1000);
}
