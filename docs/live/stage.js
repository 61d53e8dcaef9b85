// What the live pages share: forms, a player of bodies, and how a draw is shown.
import { mount } from "player";

export const place = new URL(".", document.currentScript.src).href; // of the scripts and networks

const MILLIMETRE = 0.001;
const encoded = (metres) => { // as the player reads positions: base64 of little-endian int16
  const bytes = new Uint8Array(Int16Array.from(metres, (value) => Math.round(value / MILLIMETRE)).buffer);
  let text = "";
  for (const byte of bytes) text += String.fromCharCode(byte);
  return btoa(text);
};

/** Show bodies and poses: {name, kind, positions (T, J, 3) in metres with z up, start}. A view that was turned stays, as does the time. */
export function show(host, template, bodies, { ghosts = [], ...said }) {
  const drawn = ({ positions, ...body }) => ({ ...template.bodies[0], ...body, unit: MILLIMETRE, data: encoded(positions) });
  const before = host.player;
  before?.destroy();
  host.shadowRoot?.replaceChildren();
  try {
    const player = (host.player = mount(host, { ...template, ...said, bodies: bodies.map(drawn), ghosts: ghosts.map(drawn) }));
    if (!said.goesOn || !before) return;
    player.seek(before.time), player.play(before.playing);
    if (!before.turned) return;
    player.turned = true;
    player.camera.position.copy(before.camera.position).sub(before.controls.target).add(player.controls.target);
    player.arrange();
  } catch {} // without WebGL the place itself says so
}

/** Numbers and words of a form; a number outside of its bounds is brought back into them. */
export function values(form) {
  const found = {};
  for (const field of form.elements) {
    if (!field.name) continue;
    if (field.type === "number" || field.type === "range") {
      const bounded = Math.min(Math.max(field.value === "" ? Number(field.defaultValue) : Number(field.value), Number(field.min)), Number(field.max));
      if (field.value !== String(bounded)) field.value = bounded;
      found[field.name] = bounded;
    } else found[field.name] = field.value;
  }
  return found;
}

/** Run an action at each submission, with the bar and the button of the form told of it; what goes wrong is said. */
export function whenAsked(host, output, act) {
  const form = host.querySelector("form"), bar = host.querySelector("progress"), button = form.querySelector("button");
  const run = async () => {
    if (button.disabled) return undefined;
    button.disabled = true, bar.hidden = false, bar.value = 0;
    output.classList.remove("warned");
    try {
      if (location.protocol === "file:") throw new Error("this page was opened as a file, and a browser lets it read no model from there; serve the site, e.g. with python -m http.server");
      return await act((share, text) => ((bar.value = share), text && (output.value = text)));
    } catch (error) {
      output.classList.add("warned");
      output.value = `That did not work: ${error.message}.`;
      return undefined;
    } finally {
      button.disabled = false, bar.hidden = true;
    }
  };
  form.addEventListener("submit", (event) => (event.preventDefault(), run()));
}

export const megabytes = (bytes) => `${(bytes / 1e6).toFixed(1)} MB`;
