// Features of HumanML3D to joints: `joints_of`, `fused_joints` and `steady_bones` of mwlib. Flat arrays, frame after frame, y up.

/** Solve (I + D' W D) x = p + D' W u for one coordinate, D the difference of neighbours: Thomas' algorithm. */
function agreeing(p, u, w) {
  const n = p.length, above = new Float64Array(n), x = new Float64Array(n);
  for (let t = 0; t < n; t++) {
    const back = t ? w[t - 1] : 0, on = t < n - 1 ? w[t] : 0; // weights of the steps to t and from t
    const right = p[t] + (t ? back * u[t - 1] : 0) - (t < n - 1 ? on * u[t] : 0);
    const pivot = 1 + back + on + (t ? back * above[t - 1] : 0);
    above[t] = -on / pivot;
    x[t] = (right + (t ? back * x[t - 1] : 0)) / pivot;
  }
  for (let t = n - 2; t >= 0; t--) x[t] -= above[t] * x[t + 1];
  return x;
}

/** Joints (T, J, 3) that agree with the places, steps and contacts that raw features (T, D) say. */
export function fusedJoints(features, about) {
  const { blocks, contact_joints: feet, arm_joints: arms, weights } = about, J = about.skeleton.joints.length, D = about.mean.length;
  const T = features.length / D, at = (t, name, i = 0) => features[t * D + blocks[name][0] + i];
  const angle = new Float64Array(T), path = [[0, 0]], places = new Float64Array(T * J * 3), steps = new Float64Array(T * J * 3);
  for (let t = 1; t < T; t++) angle[t] = angle[t - 1] + 2 * at(t - 1, "yaw_rate");
  const world = (t, x, z) => { // from the body's heading into the world
    const cos = Math.cos(angle[t]), sin = Math.sin(angle[t]);
    return [cos * x - sin * z, sin * x + cos * z];
  };
  for (let t = 1; t < T; t++) {
    const [x, z] = world(t, at(t - 1, "root_velocity", 0), at(t - 1, "root_velocity", 1));
    path.push([path[t - 1][0] + x, path[t - 1][1] + z]);
  }
  for (let t = 0; t < T; t++)
    for (let j = 0; j < J; j++) {
      const local = (k) => (j ? at(t, "positions", 3 * (j - 1) + k) : k === 1 ? at(t, "height") : 0);
      const [x, z] = world(t, local(0), local(2)), i = 3 * (t * J + j);
      places.set([x + path[t][0], local(1), z + path[t][1]], i);
      const [u, w] = world(t, at(t, "velocities", 3 * j), at(t, "velocities", 3 * j + 2));
      steps.set([u, at(t, "velocities", 3 * j + 1), w], i);
    }
  const out = new Float64Array(places.length), moments = [...Array(T).keys()];
  for (let j = 0; j < J; j++) {
    const foot = feet.indexOf(j), stands = moments.map((t) => foot >= 0 && at(t, "contacts", foot) > 0.5);
    for (let k = 0; k < 3; k++) {
      const of = (from) => moments.map((t) => from[3 * (t * J + j) + k]);
      const usual = arms.includes(j) ? weights.arm : k === 1 ? weights.height : weights.step;
      const w = stands.map((still) => (k !== 1 && still ? weights.contact : usual));
      const u = of(steps).map((step, t) => (k !== 1 && stands[t] ? 0 : step));
      agreeing(of(places), u, w).forEach((value, t) => (out[3 * (t * J + j) + k] = value * about.metres_per_unit));
    }
  }
  return out;
}

/** The same with each bone as long, in all frames, as in the median one; parents stand before their children. */
export function steadyBones(joints, parents) {
  const out = Float64Array.from(joints), J = parents.length, moments = [...Array(joints.length / (3 * J)).keys()];
  for (let j = 1; j < J; j++) {
    const at = (t, of) => 3 * (t * J + of), bones = moments.map((t) => [0, 1, 2].map((k) => joints[at(t, j) + k] - joints[at(t, parents[j]) + k]));
    const lengths = bones.map((bone) => Math.hypot(...bone)), sorted = lengths.toSorted((a, b) => a - b), half = (sorted.length - 1) / 2;
    const usual = (sorted[Math.floor(half)] + sorted[Math.ceil(half)]) / 2;
    for (const t of moments)
      for (let k = 0; k < 3; k++) out[at(t, j) + k] = out[at(t, parents[j]) + k] + (usual / Math.max(lengths[t], 1e-6)) * bones[t][k];
  }
  return out;
}
