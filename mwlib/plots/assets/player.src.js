// A player of moving skeletons: panels side by side or one over the other, a bar to play, stop and search, an orbiting camera.
// Python (mwlib/plots/playing.py) makes the payload; three.js draws; `make player` bundles this file into player.js.
// One WebGL context serves all players of a page, as browsers allow about sixteen; each player shows a copy of its pixels.
import { PCFShadowMap, PerspectiveCamera, Vector3, WebGLRenderer } from "three";
import { OrbitControls } from "three/addons/controls/OrbitControls.js";
import css from "./player.css";
import { Body, Panel } from "./scene.src.js";

const UP = new Vector3(0, 0, 1);
const SPEEDS = [0.1, 0.25, 0.5, 1, 2];
const GAP = 8, LABEL = 34; // pixels: between panels; of a name, which no head may hide
const LONGEST = 0.2; // seconds between two pictures: a machine that needs more plays slower and leaves nothing out
const REST = 0.5; // seconds that a loop waits on its last frame
const EXPLODED = 2; // times as wide as the smallest body: such a one is cut off and does not shrink the others
const ICONS = {
  play: "M5 3l10 6-10 6z", pause: "M6 3v12M12 3v12", loop: "M3 9V8a3 3 0 0 1 3-3h8M11 2l3 3-3 3M15 9v1a3 3 0 0 1-3 3H4M7 16l-3-3 3-3",
  overlay: "M2 6l7-4 7 4-7 4zM2 10.5l7 4 7-4", follow: "M9 1v4M9 13v4M1 9h4M13 9h4M9 5a4 4 0 1 1 0 8a4 4 0 0 1 0-8z",
  reset: "M2 7V2h5M11 2h5v5M16 11v5h-5M7 16H2v-5",
};
let shared; // the page's renderer

function renderer(width, height) {
  if (!shared) {
    shared = new WebGLRenderer({ antialias: true, alpha: true });
    shared.shadowMap.enabled = true;
    shared.shadowMap.type = PCFShadowMap;
    shared.setClearColor(0, 0);
    shared.setScissorTest(true);
    shared.extent = new Vector3();
  }
  const ratio = Math.min(devicePixelRatio, 2), { extent } = shared;
  if (shared.getPixelRatio() !== ratio) shared.setPixelRatio(ratio);
  if (width > extent.x || height > extent.y) {
    extent.set(Math.max(width, extent.x), Math.max(height, extent.y), 0);
    shared.setSize(extent.x, extent.y, false);
  }
  return shared;
}

function make(kind, parent, attributes = {}, text = "") {
  const node = document.createElement(kind);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  node.textContent = text;
  parent.append(node);
  return node;
}

function isDark(node) { // what lies behind the player decides, whatever the page calls its themes
  for (let at = node; at; at = at.parentElement ?? at.getRootNode().host) {
    const colour = getComputedStyle(at).backgroundColor.match(/[\d.]+/g) ?? [0, 0, 0, 0]; // none while it is not in a document yet
    const [red, green, blue, alpha = 1] = colour.map(Number);
    if (alpha > 0.5) return 0.3 * red + 0.59 * green + 0.11 * blue < 110;
  }
  return getComputedStyle(document.documentElement).colorScheme.includes("dark") && matchMedia("(prefers-color-scheme: dark)").matches;
}

class Player {
  constructor(host, payload, onchange) {
    Object.assign(this, { host, payload, onchange, time: 0, playing: false, last: payload.frames - 1, undo: [] });
    Object.assign(this, { speed: payload.speed, looping: payload.loop, overlaid: payload.layout === "overlay", following: payload.follow });
    this.bodies = payload.bodies.map((said) => new Body(said, payload.fps));
    this.build(host.shadowRoot ?? host.attachShadow({ mode: "open" }));
    this.camera = new PerspectiveCamera(28, 1, 0.05, 200);
    this.camera.up.copy(UP);
    this.controls = new OrbitControls(this.camera, this.canvas);
    Object.assign(this.controls, { enableZoom: false, maxPolarAngle: 1.62, minDistance: 0.5, maxDistance: 80 });
    this.canvas.style.touchAction = "pan-y"; // a finger that goes up or down scrolls the page; sideways it turns the view
    this.listen();
    this.theme();
    this.arrange();
    this.play(payload.autoplay && !matchMedia("(prefers-reduced-motion: reduce)").matches);
  }
  build(root) {
    const { alt, frames, height, history, keyframes } = this.payload, share = (frame) => frame / Math.max(frames - 1, 1);
    root.replaceChildren();
    make("style", root, {}, css);
    const said = { tabindex: 0, role: "group", "aria-roledescription": "3-D player", "aria-label": alt };
    this.box = make("div", root, { class: "box", ...said, "data-lm-suppress-shortcuts": "true" }); // JupyterLab would take the keys
    this.stage = make("div", this.box, { class: "stage", style: `height:${height}px` });
    this.backs = make("div", this.stage);
    this.canvas = make("canvas", this.stage, { role: "img", "aria-label": alt });
    this.context = this.canvas.getContext("2d");
    const bar = make("div", this.box, { class: "bar" });
    this.buttons = { play: this.button(bar, "play", "Play (space)", () => this.play(!this.playing)) };
    const track = make("div", bar, { class: "track" });
    make("div", track, { class: "rail" });
    this.done = make("div", track, { class: "done" });
    if (history) make("div", track, { class: "past", style: `width:calc((100% - 14px) * ${share(history - 1)})` });
    for (const frame of keyframes)
      make("div", track, { class: "mark", style: `left:calc(7px + (100% - 14px) * ${share(frame)})`, title: `keyframe, ${this.seconds(frame)}` });
    this.slider = make("input", track, { type: "range", min: 0, max: this.last, step: 1, "aria-label": "Time" });
    this.clock = make("output", bar, { class: "clock" });
    this.picker = make("select", bar, { "aria-label": "Speed" });
    for (const speed of new Set([...SPEEDS, this.speed].sort((x, y) => x - y))) make("option", this.picker, { value: speed }, `${speed}×`);
    this.buttons.looping = this.button(bar, "loop", "Loop (l)", () => this.toggle("looping"));
    if (this.bodies.length > 1) this.buttons.overlaid = this.button(bar, "overlay", "One over the other (o)", () => this.toggle("overlaid"));
    this.buttons.following = this.button(bar, "follow", "Follow the body (f)", () => this.toggle("following"));
    this.button(bar, "reset", "Reset the view (r)", () => this.reset());
  }
  button(bar, icon, title, act) {
    const node = make("button", bar, { type: "button", title, "aria-label": title });
    node.innerHTML = `<svg viewBox="0 0 18 18" aria-hidden="true"><path d="${ICONS[icon]}"/></svg>`;
    node.addEventListener("click", act);
    return node;
  }
  on(target, name, act) {
    target.addEventListener(name, act);
    this.undo.push(() => target.removeEventListener(name, act));
  }
  watch(observer, targets, options) {
    for (const target of targets) observer.observe(target, options);
    this.undo.push(() => observer.disconnect());
  }
  listen() {
    this.on(this.slider, "input", () => this.seek(Number(this.slider.value), true));
    this.on(this.picker, "change", () => this.rate(Number(this.picker.value)));
    this.on(this.box, "keydown", (event) => this.key(event));
    this.controls.addEventListener("change", () => this.draw());
    this.controls.addEventListener("start", () => (this.turned = true));
    // the wheel scrolls the page until somebody takes hold of the picture
    this.on(this.canvas, "pointerdown", () => (this.controls.enableZoom = true));
    this.on(this.box, "pointerleave", ({ pointerType, buttons }) => (this.controls.enableZoom &&= pointerType === "touch" || buttons > 0));
    this.on(matchMedia("(prefers-color-scheme: dark)"), "change", () => this.theme());
    const theme = () => setTimeout(() => this.theme(), 50); // when the page's own styles have followed
    this.watch(new MutationObserver(theme), [document.documentElement, document.body], { attributes: true });
    this.watch(new ResizeObserver(() => this.arrange()), [this.stage]);
    const seen = ([entry]) => ((this.visible = entry.isIntersecting), (this.before = undefined), this.draw());
    this.watch(new IntersectionObserver(seen), [this.stage]);
  }
  key(event) {
    if (event.altKey || event.ctrlKey || event.metaKey || event.target === this.picker) return;
    const step = { ArrowLeft: -1, ArrowRight: 1 }[event.key], keys = { l: "looping", o: "overlaid", f: "following" };
    if (step && event.shiftKey) this.orbit(0.12 * step);
    else if (step) this.seek(Math.round(this.time) + step, true);
    else if (event.key === "Home") this.seek(0, true);
    else if (event.key === "End") this.seek(this.last, true);
    else if (event.key === " " && event.target.tagName !== "BUTTON") this.play(!this.playing);
    else if (this.buttons[keys[event.key]]) this.toggle(keys[event.key]);
    else if (event.key === "r") this.reset();
    else return;
    event.preventDefault();
    event.stopPropagation();
  }
  play(playing) {
    if (playing && !this.looping && this.time >= this.last) this.time = 0;
    if (!playing) this.time = Math.min(Math.round(this.time), this.last);
    Object.assign(this, { playing, before: undefined });
    this.buttons.play.querySelector("path").setAttribute("d", ICONS[playing ? "pause" : "play"]);
    for (const name of ["aria-label", "title"]) this.buttons.play.setAttribute(name, playing ? "Pause (space)" : "Play (space)");
    this.draw();
  }
  seek(time, stop = false) {
    if (stop && this.playing) this.play(false);
    this.time = Math.min(Math.max(time, 0), this.last);
    this.draw();
  }
  rate(speed) {
    this.speed = speed;
    this.draw();
  }
  toggle(what) {
    this[what] = !this[what];
    this.arrange();
  }
  orbit(angle) {
    const { target } = this.controls;
    this.turned = true;
    this.camera.position.sub(target).applyAxisAngle(UP, angle).add(target);
    this.controls.update();
  }
  reset() {
    this.turned = false;
    this.arrange();
  }
  theme() {
    const dark = isDark(this.host);
    this.box.classList.toggle("dark", dark);
    this.colours = this.payload.colours[dark ? "dark" : "light"];
    for (const body of this.bodies) body.painted = undefined;
    this.panels?.forEach((panel) => panel.paint(this.colours));
    this.draw();
  }
  arrange() { // who stands in which panel, where the panels lie, and what the camera must hold
    const { bodies } = this, { ghosts, fps } = this.payload, width = this.stage.clientWidth, height = this.stage.clientHeight;
    for (const name of ["looping", "overlaid", "following"]) this.buttons[name]?.setAttribute("aria-pressed", this[name]);
    if (!width || !height) return;
    if (this.arranged !== this.overlaid) {
      this.panels?.forEach((panel) => panel.free());
      const sets = this.overlaid ? [bodies] : bodies.map((body) => [body]);
      this.panels = sets.map((set) => new Panel(set, ghosts.filter(({ of }) => of.some((i) => set.includes(bodies[i]))), fps, sets.length === 1));
      this.panels.forEach((panel) => panel.paint(this.colours));
      this.arranged = this.overlaid;
    }
    const calm = EXPLODED * Math.min(...bodies.map((body) => body.spread));
    const held = this.panels.filter((panel) => panel.bodies.some((body) => body.spread <= calm));
    this.points = held.flatMap((panel) => panel.cloud(this.following));
    const towards = this.turned ? this.camera.position.clone().sub(this.controls.target).normalize() : this.front();
    const { high, wide } = this.seen(towards), count = this.panels.length;
    const scale = (columns) => Math.min(width / columns / wide, height / Math.ceil(count / columns) / high);
    const columns = [...Array(count).keys()].map((i) => i + 1).reduce((best, next) => (scale(next) > 1.02 * scale(best) ? next : best));
    const rows = Math.ceil(count / columns), w = (width - GAP * (columns - 1)) / columns, h = (height - GAP * (rows - 1)) / rows;
    this.cells = this.panels.map((_, i) => ({ x: (i % columns) * (w + GAP), y: Math.floor(i / columns) * (h + GAP), w, h }));
    this.label();
    this.camera.aspect = w / h;
    this.camera.updateProjectionMatrix();
    this.fit(towards);
  }
  label() {
    this.backs.replaceChildren();
    this.panels.forEach(({ bodies }, i) => {
      const { x, y, w, h } = this.cells[i];
      const back = make("div", this.backs, { class: "panel", style: `left:${x}px;top:${y}px;width:${w}px;height:${h}px` });
      make("div", back, { class: "label" }, bodies.map((body) => body.name).filter(Boolean).join(" · "));
    });
  }
  front() {
    const [azimuth, elevation] = [this.payload.azimuth, this.payload.elevation].map((degrees) => (degrees * Math.PI) / 180);
    return new Vector3(Math.cos(elevation) * Math.cos(azimuth), Math.cos(elevation) * Math.sin(azimuth), Math.sin(elevation));
  }
  seen(towards) { // the points from there: their middle, how wide and high they are
    const right = new Vector3().crossVectors(UP, towards).normalize(), up = new Vector3().crossVectors(towards, right);
    const [across, over, along] = [right, up, towards].map((axis) => {
      const all = this.points.map((point) => point.dot(axis));
      return [all.reduce((x, y) => Math.min(x, y)), all.reduce((x, y) => Math.max(x, y))];
    });
    const middle = (range) => (range[0] + range[1]) / 2;
    const centre = right.clone().multiplyScalar(middle(across)).addScaledVector(up, middle(over)).addScaledVector(towards, middle(along));
    return { right, up, centre, wide: across[1] - across[0] + 0.2, high: over[1] - over[0] + 0.2 };
  }
  fit(towards) { // as near as all points stay inside
    const { right, up, high, centre } = this.seen(towards), tall = Math.tan((this.camera.fov * Math.PI) / 360), wide = tall * this.camera.aspect;
    centre.addScaledVector(up, (LABEL / this.cells[0].h) * 0.6 * high);
    const need = this.points.map((point) => {
      const p = point.clone().sub(centre);
      return p.dot(towards) + Math.max((Math.abs(p.dot(right)) + 0.08) / wide, (Math.abs(p.dot(up)) + 0.12) / tall);
    });
    this.controls.target.copy(centre);
    this.camera.position.copy(centre).addScaledVector(towards, 1.04 * need.reduce((x, y) => Math.max(x, y)));
    this.controls.update();
    this.draw();
  }
  seconds(frame) {
    const time = (frame - Math.max(this.payload.history - 1, 0)) / this.payload.fps;
    return `${time > 0 && this.payload.history ? "+" : ""}${time.toFixed(2)} s`.replace("-", "−");
  }
  draw() {
    this.pending ??= requestAnimationFrame((now) => this.tick(now));
  }
  tick(now) {
    this.pending = undefined;
    if (!this.visible || !this.cells) return;
    if (this.playing) {
      this.time += Math.min((now - (this.before ?? now)) / 1000, LONGEST) * this.payload.fps * this.speed;
      this.before = now;
      if (this.looping && this.time >= this.last + REST * this.payload.fps) this.time = 0;
      if (!this.looping && this.time >= this.last) this.play(false);
    }
    this.render(Math.min(this.time, this.last));
    this.told(Math.min(Math.round(this.time), this.last));
    if (this.playing) this.draw();
  }
  told(frame) { // everything that says where the film is
    const { history } = this.payload, said = this.seconds(frame) + (frame < history ? " observed" : "");
    if (this.clock.value !== said) this.clock.value = said;
    this.slider.value = frame;
    this.slider.setAttribute("aria-valuetext", said);
    this.done.style.width = `calc((100% - 14px) * ${frame / Math.max(this.last, 1)})`;
    this.picker.value = this.speed;
    this.onchange({ frame, playing: this.playing, speed: this.speed });
  }
  render(time) {
    const width = this.stage.clientWidth, height = this.stage.clientHeight, { canvas, colours, context } = this;
    const gl = renderer(width, height), ratio = gl.getPixelRatio(), past = Math.round(time) < this.payload.history;
    for (const body of this.bodies) {
      const kind = past ? "observed" : body.kind, opacity = this.overlaid && kind === "predicted" ? Math.max(0.35, 1 / this.bodies.length) : 1;
      if (body.painted !== kind + opacity) body.paint(colours[kind], colours.paper, opacity);
      body.painted = kind + opacity;
    }
    gl.setScissor(0, gl.extent.y - height, width, height);
    gl.clear(); // the gaps, too: another player's pixels are there
    this.panels.forEach((panel, i) => {
      const { x, y, w, h } = this.cells[i], place = [x, gl.extent.y - y - h, w, h];
      panel.show(time, this.following);
      gl.setViewport(...place);
      gl.setScissor(...place);
      gl.render(panel.scene, this.camera);
    });
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== w || canvas.height !== h) Object.assign(canvas, { width: w, height: h });
    context.clearRect(0, 0, w, h);
    context.drawImage(gl.domElement, 0, 0, w, h, 0, 0, w, h);
  }
  destroy() {
    this.undo.forEach((act) => act());
    this.controls.dispose();
    this.panels?.forEach((panel) => panel.free());
    this.bodies.forEach((body) => body.free());
    cancelAnimationFrame(this.pending);
  }
}

/** Put a player into an element; onchange hears of frame, playing and speed. */
export function mount(host, payload, onchange = () => {}) {
  try {
    return new Player(host, payload, onchange);
  } catch (error) {
    host.shadowRoot?.replaceChildren();
    make("p", host.shadowRoot ?? host, { role: "img" }, `${payload.alt} (This picture could not be drawn: ${error.message})`);
    throw error;
  }
}

/** Fill every place that a page's HTML keeps for a player, once. */
export function mountAll() {
  for (const host of document.querySelectorAll(".mwlib-player:not([data-mounted])")) {
    host.dataset.mounted = "";
    mount(host, JSON.parse(host.querySelector("script").textContent));
  }
}
