// What stands in a player's panels: skeletons of tubes and balls, the floor with its grid and shadow, the root's path. Metres, z up.
import {
  BufferGeometry, CircleGeometry, Color, CylinderGeometry, DirectionalLight, Float32BufferAttribute, HemisphereLight, InstancedMesh,
  LineBasicMaterial, LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, Object3D, PlaneGeometry, Scene, ShadowMaterial,
  SphereGeometry, Vector3,
} from "three";

const STRIPE = 0.06; // metres: right limbs are striped, so that colour alone never tells the sides apart
const GHOST = 0.35; // opacity; a ghost fades where a body comes to stand in it
const UP = new Vector3(0, 0, 1), Y = new Vector3(0, 1, 0);
const scratch = new Object3D(), a = new Vector3(), b = new Vector3(); // filled anew before each use

function metres(text, unit) { // base64 of little-endian int16 -> Float32Array
  const bytes = Uint8Array.from(atob(text), (c) => c.charCodeAt(0)), view = new DataView(bytes.buffer);
  return Float32Array.from({ length: bytes.length / 2 }, (_, i) => view.getInt16(2 * i, true) * unit);
}

export class Body { // one moving skeleton: a tube per bone, a ball per joint
  constructor(said, fps) {
    Object.assign(this, said);
    this.joints = said.parents.length;
    this.places = metres(said.data, said.unit);
    this.count = this.places.length / (3 * this.joints);
    this.pose = this.places.slice(0, 3 * this.joints);
    this.track = this.smoothed(Math.round(fps / 2));
    this.spread = this.cloud((frame) => this.track[frame]).reduce((most, p) => Math.max(most, p.length()), 0);
    this.parts = said.parents.flatMap((parent, joint) => this.pieces(parent, joint, said.size));
    this.material = new MeshLambertMaterial({ transparent: true });
    this.tubes = this.instances(new CylinderGeometry(1, 1, 1, 12, 1, true), this.parts.length);
    this.balls = this.instances(new SphereGeometry(1, 14, 10), this.joints);
    this.group = new Object3D();
    this.group.add(this.tubes, this.balls);
  }
  instances(geometry, count) {
    const mesh = new InstancedMesh(geometry, this.material, Math.max(count, 1));
    mesh.count = count;
    mesh.castShadow = true;
    mesh.frustumCulled = false;
    return mesh;
  }
  pieces(parent, joint, size) { // right bones in stripes, the others whole
    if (parent < 0) return [];
    a.fromArray(this.pose, 3 * parent);
    b.fromArray(this.pose, 3 * joint);
    const stripes = this.sides[joint] === "r" ? 2 * Math.round(a.distanceTo(b) / STRIPE / 2) + 1 : 1;
    const radius = size * (this.sides[joint] === "m" ? 0.02 : 0.017);
    return Array.from({ length: stripes }, (_, i) => ({ parent, joint, radius, from: i / stripes, to: (i + 1) / stripes, pale: i % 2 }));
  }
  smoothed(half) { // where the root is over the floor, without its sway
    const sums = [[0, 0]];
    for (let f = 0; f < this.count; f++) sums.push([0, 1].map((k) => sums[f][k] + this.places[3 * this.joints * f + k]));
    return Array.from({ length: this.count }, (_, f) => {
      const reach = Math.min(half, f, this.count - 1 - f), [from, to] = [f - reach, f + reach + 1];
      return [0, 1].map((k) => (sums[to][k] - sums[from][k]) / (to - from));
    });
  }
  at(time) { // frames of the player -> frames of this body
    return Math.min(Math.max(time - this.start, 0), this.count - 1);
  }
  above(time) {
    const at = this.at(time), low = Math.floor(at), high = Math.min(low + 1, this.count - 1);
    return [0, 1].map((k) => this.track[low][k] + (at - low) * (this.track[high][k] - this.track[low][k]));
  }
  cloud(origin) { // joints at about a hundred moments, seen from a place on the floor that may go along
    const points = [], step = Math.ceil(this.count / 100);
    for (let f = 0; f < this.count; f += step) {
      const [x, y] = origin(f);
      for (let i = f * this.pose.length; i < (f + 1) * this.pose.length; i += 3)
        points.push(new Vector3(this.places[i] - x, this.places[i + 1] - y, this.places[i + 2]));
    }
    return points;
  }
  show(time) {
    const at = this.at(time), low = Math.floor(at), share = at - low, width = 3 * this.joints;
    const from = low * width, to = Math.min(low + 1, this.count - 1) * width;
    for (let i = 0; i < width; i++) this.pose[i] = this.places[from + i] + share * (this.places[to + i] - this.places[from + i]);
    this.group.visible = time >= this.start - 0.5;
    this.parts.forEach(({ parent, joint, radius, from, to }, i) => {
      a.fromArray(this.pose, 3 * parent);
      b.fromArray(this.pose, 3 * joint).sub(a);
      scratch.position.copy(a).addScaledVector(b, (from + to) / 2);
      scratch.scale.set(radius, Math.max(b.length() * (to - from), 1e-6), radius);
      scratch.quaternion.setFromUnitVectors(Y, b.lengthSq() > 1e-12 ? b.normalize() : Y);
      this.place(this.tubes, i);
    });
    scratch.quaternion.identity();
    for (let joint = 0; joint < this.joints; joint++) {
      scratch.position.fromArray(this.pose, 3 * joint);
      scratch.scale.setScalar(this.size * (this.heads.includes(joint) ? 0.052 : this.sides[joint] === "m" ? 0.02 : 0.0185));
      this.place(this.balls, joint);
    }
    this.tubes.instanceMatrix.needsUpdate = this.balls.instanceMatrix.needsUpdate = true;
  }
  place(mesh, index) {
    scratch.updateMatrix();
    mesh.setMatrixAt(index, scratch.matrix);
  }
  paint(colours, paper, opacity) { // colours of the middle, left and right
    const of = Object.fromEntries(["m", "l", "r"].map((side, i) => [side, new Color(colours[i])]));
    const pale = of.r.clone().lerp(new Color(paper), 0.55);
    this.parts.forEach((part, i) => this.tubes.setColorAt(i, part.pale ? pale : of[this.sides[part.joint]]));
    for (let joint = 0; joint < this.joints; joint++) this.balls.setColorAt(joint, of[this.sides[joint]]);
    this.tubes.instanceColor.needsUpdate = this.balls.instanceColor.needsUpdate = true;
    this.material.opacity = opacity;
  }
  free() {
    for (const mesh of [this.tubes, this.balls]) mesh.geometry.dispose(), mesh.dispose();
    this.material.dispose();
  }
}

export class Panel { // one scene: floor, light, and the bodies that stand on it
  constructor(bodies, ghosts, fps, alone) {
    Object.assign(this, { bodies, fps });
    this.ghosts = ghosts.map((said) => new Body(said, fps));
    const edges = [0, 1].map((k) => bodies.flatMap((body) => body.track.map((place) => place[k])));
    const [low, high] = [Math.min, Math.max].map((end) => edges.map((all) => all.reduce((x, y) => end(x, y))));
    this.centre = [0, 1].map((k) => (low[k] + high[k]) / 2);
    this.reach = Math.hypot(high[0] - low[0], high[1] - low[1]) / 2;
    this.sun = new DirectionalLight(0xffffff, 2.2);
    this.sun.castShadow = true;
    this.sun.shadow.mapSize.setScalar(alone ? 1024 : 512);
    Object.assign(this.sun.shadow, { radius: 4, bias: -0.002 });
    const wide = 1.6 + (bodies.length > 1 ? Math.min(this.reach, 4) : 0);
    Object.assign(this.sun.shadow.camera, { left: -wide, right: wide, top: wide, bottom: -wide, near: 0.1, far: 20 });
    this.sky = new HemisphereLight(0xffffff, 0xa8adb5, 1.9);
    this.sky.position.copy(UP);
    this.floor = new Mesh(new PlaneGeometry(200, 200), new ShadowMaterial({ opacity: 0.25 }));
    this.floor.receiveShadow = true;
    this.grid = grid(2.2 + Math.min(this.reach, 8));
    this.paths = bodies.map((body) => dots(body, fps));
    for (const ghost of this.ghosts) ghost.show(0), (ghost.tubes.castShadow = ghost.balls.castShadow = false);
    this.scene = new Scene();
    this.scene.add(this.sun, this.sun.target, this.sky, this.floor, this.grid, ...this.paths);
    this.scene.add(...[...bodies, ...this.ghosts].map((body) => body.group));
  }
  cloud(following) {
    const held = (time) => (following ? this.middle(time) : this.centre);
    return this.bodies.flatMap((body) => body.cloud((frame) => held(frame + body.start)));
  }
  middle(time) { // of all bodies
    const all = this.bodies.map((body) => body.above(time));
    return [0, 1].map((k) => all.reduce((sum, place) => sum + place[k], 0) / all.length);
  }
  show(time, following) {
    for (const body of this.bodies) body.show(time);
    for (const ghost of this.ghosts) ghost.material.opacity = GHOST * Math.min(1, Math.abs(time - ghost.frame) / (0.4 * this.fps));
    this.paths.forEach((path, i) => path.upTo(this.bodies[i].at(time)));
    const at = this.middle(time), held = following ? at : this.centre;
    this.scene.position.set(-held[0], -held[1], 0);
    this.grid.position.set(Math.round(held[0]), Math.round(held[1]), 0.002);
    this.sun.target.position.set(at[0], at[1], 0);
    this.sun.position.set(at[0] + 1.5, at[1] + 1, 7);
  }
  paint(colours) {
    this.grid.material.color.set(colours.grid);
    this.floor.material.opacity = colours.shadow;
    this.paths.forEach((path, i) => path.paint(colours.grid, colours[this.bodies[i].kind][1]));
    for (const ghost of this.ghosts) ghost.paint([colours.ghost, colours.ghost, colours.ghost], colours.ghost, GHOST);
  }
  free() {
    for (const thing of [this.floor, this.grid, ...this.paths]) thing.geometry.dispose(), thing.material.dispose();
    this.ghosts.forEach((ghost) => ghost.free());
    this.sun.dispose();
  }
}

function grid(reach) { // lines every metre that fade towards the edge
  const points = [], alphas = [], edge = Math.ceil(reach);
  const add = (x, y) => (points.push(x, y, 0), alphas.push(1, 1, 1, Math.max(0, 1 - Math.hypot(x, y) / reach) ** 0.7));
  for (let line = -edge; line <= edge; line++) {
    for (let from = -edge; from < edge; from += 0.5) for (const at of [from, from + 0.5]) add(line, at);
    for (let from = -edge; from < edge; from += 0.5) for (const at of [from, from + 0.5]) add(at, line);
  }
  const geometry = new BufferGeometry().setAttribute("position", new Float32BufferAttribute(points, 3));
  geometry.setAttribute("color", new Float32BufferAttribute(alphas, 4));
  return new LineSegments(geometry, new LineBasicMaterial({ vertexColors: true, transparent: true, depthWrite: false }));
}

function dots(body, fps) { // where the root goes: a dot on the floor every tenth of a second; none for a body on its spot
  const step = Math.max(1, Math.round(fps / 10)), width = 3 * body.joints, count = Math.ceil(body.count / step);
  const mesh = new InstancedMesh(new CircleGeometry(0.022, 20), new MeshBasicMaterial({ transparent: true, depthWrite: false }), count);
  const spots = Array.from({ length: count }, (_, i) => [0, 1].map((k) => body.places[width * step * i + k]));
  mesh.visible = [0, 1].some((k) => Math.max(...spots.map((s) => s[k])) - Math.min(...spots.map((s) => s[k])) > 0.2);
  spots.forEach(([x, y], i) => mesh.setMatrixAt(i, scratch.matrix.makeTranslation(x, y, 0.006)));
  mesh.paint = (ahead, behind) => Object.assign(mesh, { ahead: new Color(ahead), behind: new Color(behind) });
  mesh.upTo = (at) => {
    for (let i = 0; i < count; i++) mesh.setColorAt(i, step * i <= at ? mesh.behind : mesh.ahead);
    mesh.instanceColor.needsUpdate = true;
  };
  return mesh;
}
