// Feet that stand, held in place by legs of two bones: mwlib/body/standing.py, in its words. Joints (T, J, 3) are flat, z up.
const SLOW = 0.6, LEFT_BEHIND = 0.7, BRIEF = 0.3, LOW = 0.08, SHORTEST = 0.1, STRAIGHT = 0.999;

/** Hip, knee and foot of each leg by the knees' names. */
const legs = ({ joints, parents }) => joints.flatMap((name, knee) => {
  const below = parents.flatMap((parent, joint) => (parent === knee ? [joint] : []));
  return name.toLowerCase().includes("knee") && below.length === 1 ? [[parents[knee], knee, below[0]]] : [];
});

/** Height of the lowest foot in some poses. */
export const floorOf = (poses, skeleton) => Math.min(...poses.flatMap((pose) => legs(skeleton).map(([, , foot]) => pose[3 * foot + 2])));

const minus = (a, b) => a.map((value, k) => value - b[k]), dot = (a, b) => a.reduce((sum, value, k) => sum + value * b[k], 0);
const plus = (a, s, b) => a.map((value, k) => value + s * b[k]), long = (a) => Math.sqrt(dot(a, a));
const cross = ([a, b, c], [x, y, z]) => [b * z - c * y, c * x - a * z, a * y - b * x], between = (value, least, most) => Math.max(Math.min(value, most), least);

/** The joints with feet that stand where they stand, and none below the floor; the first and last frame stay. */
export function standing(joints, floor, skeleton, fps) {
  const J = skeleton.joints.length, T = joints.length / (3 * J), out = Float64Array.from(joints), last = T - 1;
  const of = (joint) => Array.from({ length: T }, (_, t) => [...joints.subarray(3 * (t * J + joint), 3 * (t * J + joint) + 3)]);
  for (const [hip, knee, foot] of legs(skeleton)) {
    const [hips, knees, path] = [hip, knee, foot].map(of), goal = held(path, hips, floor, fps), least = Math.min(floor, path[0][2], path[last][2]);
    for (let t = 1; t < last; t++) {
      goal[t][2] = Math.max(goal[t][2], least);
      bent(hips[t], knees[t], path[t], goal[t]).forEach((place, i) => out.set(place, 3 * (t * J + [knee, foot][i])));
    }
  }
  return out;
}

/** Stretches of frames, from and until, in which a foot is low, and slow or well slower than its hip. */
function stands(path, hips, floor, fps) {
  const speeds = (places) => places.slice(1).map((place, t) => long(minus(place, places[t])) * fps), ofHip = speeds(hips);
  const slow = speeds(path).map((speed, t) => speed <= Math.max(SLOW, ofHip.length > BRIEF * fps ? LEFT_BEHIND * ofHip[t] : 0));
  const still = path.map((place, t) => place[2] <= floor + LOW && Boolean(slow[t - 1] || slow[t])), found = [];
  still.forEach((is, t) => is && (still[t - 1] ? (found.at(-1)[1] = t + 1) : found.push([t, t + 1])));
  return found.filter(([a, b]) => b - a >= SHORTEST * fps);
}

/** The path with the foot held where it stands. */
function held(path, hips, floor, fps) {
  const last = path.length - 1, lack = new Map([[0, [0, 0]], [last, [0, 0]]]), flat = (place) => place.slice(0, 2);
  for (const [a, b] of stands(path, hips, floor, fps)) {
    const here = path.slice(a, b).map(flat), mean = [0, 1].map((k) => here.reduce((sum, place) => sum + place[k], 0) / here.length);
    const isEnd = a === 0 || b > last, ends = isEnd ? [flat(path[a === 0 ? 0 : last]), flat(path[b > last ? last : 0])] : [mean, mean];
    here.forEach((place, i) => lack.set(a + i, minus(plus(ends[0], i / (here.length - 1), minus(ends[1], ends[0])), place)));
  }
  const known = [...lack.keys()].sort((a, b) => a - b);
  return path.map((place, t) => {
    const high = Math.max(1, known.findIndex((one) => one >= t)), [a, b] = [known[high - 1], known[high]];
    const share = (t - a) / (b - a), goes = share ** 2 * (3 - 2 * share), more = plus(lack.get(a).map((value) => value * (1 - goes)), goes, lack.get(b));
    return [place[0] + more[0], place[1] + more[1], place[2]];
  });
}

/** Knee and foot of a leg whose foot is to be at the goal, or as near as it reaches. */
function bent(hip, knee, foot, goal) {
  const thigh = long(minus(knee, hip)), shin = long(minus(foot, knee)), way = minus(goal, hip), far = long(way);
  const reach = Math.max(between(far, Math.abs(thigh - shin) / STRAIGHT, Math.max(long(minus(foot, hip)), STRAIGHT * (thigh + shin))), 1e-9);
  const axis = way.map((value) => value / Math.max(far, 1e-9)), bend = minus(knee, hip);
  const aside = long(cross(axis, bend)) > 1e-6 ? bend : [axis[1], axis[2], axis[0]], out = plus(aside, -dot(aside, axis), axis), size = Math.max(long(out), 1e-9);
  const along = (thigh ** 2 + reach ** 2 - shin ** 2) / (2 * reach), off = Math.sqrt(Math.max(thigh ** 2 - along ** 2, 0));
  return [plus(plus(hip, along, axis), off / size, out), plus(hip, reach, axis)];
}
