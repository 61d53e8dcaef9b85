// The page "Wavelet": a signal drawn by hand, its bands, and what comes back from the coefficients that one keeps.
import filters from "live/filters.json";
import { wavedec, waverec } from "./dwt.js";

const host = document.querySelector("#live-wavelet"), form = host.querySelector("form"), output = host.querySelector("output");
const svg = host.querySelector(".signal"), rows = host.querySelector(".bands");
const N = 128, HIGH = 200;
const SIGNALS = {
  step: (n) => (n < N / 2 ? -0.5 : 0.5),
  swing: (n) => (n > 20 && n < 84 ? 0.7 * Math.sin((n - 20) / 5) : 0),
  chirp: (n) => 0.7 * Math.sin((n / 18) ** 2.2),
  noise: () => 1.4 * (Math.random() - 0.5),
};
let x = [], cursor = 0;
const left = new Set(); // bands that are left out

const make = (kind, attributes) => {
  const node = document.createElementNS("http://www.w3.org/2000/svg", kind);
  for (const [name, value] of Object.entries(attributes)) node.setAttribute(name, value);
  return node;
};
const line = (values, kind) => make("polyline", { class: kind, points: values.map((value, n) => `${10 * n},${HIGH / 2 - (HIGH / 2 - 8) * value}`).join(" ") });

/** Bands, those coefficients that are kept, and the signal of these. */
function transformed(signal, { wavelet, mode, level, share }, without = left) {
  const bands = wavedec(signal, filters[wavelet], mode, level), sizes = bands.flat().map(Math.abs).sort((p, q) => q - p);
  const count = Math.round((share / 100) * sizes.length), least = count ? sizes[count - 1] : Infinity;
  const kept = bands.map((band, i) => band.map((c) => (!without.has(i) && Math.abs(c) >= least ? c : 0)));
  return { bands, kept, back: waverec(kept, filters[wavelet], signal.length) };
}

function draw() {
  const { wavelet, mode } = form.elements, level = Math.min(Math.max(Math.round(Number(form.elements.level.value)) || 1, 1), 5);
  const { bands, kept, back } = transformed(x, { wavelet: wavelet.value, mode: mode.value, level, share: Number(form.elements.share.value) });
  svg.replaceChildren(make("line", { class: "axis", x1: 0, x2: 10 * N, y1: HIGH / 2, y2: HIGH / 2 }), line(x, "drawn"), line(back, "rebuilt"));
  if (document.activeElement === svg) svg.append(make("line", { class: "axis", x1: 10 * cursor, x2: 10 * cursor, y1: 0, y2: HIGH }));
  svg.setAttribute("aria-valuenow", x[cursor].toFixed(2));
  svg.setAttribute("aria-valuetext", `sample ${cursor + 1} of ${N}: ${x[cursor].toFixed(2)}`);
  if (rows.children.length !== bands.length) offer(level);
  const most = Math.max(...bands.flat().map(Math.abs), 1e-9);
  bands.forEach((band, i) => {
    const plot = rows.children[i].querySelector("svg"), wide = 1000 / band.length;
    plot.replaceChildren(make("line", { class: "axis", x1: 0, x2: 1000, y1: 50, y2: 50 }), ...band.map((c, k) => {
      const high = (48 * Math.abs(c)) / most;
      return make("rect", { class: kept[i][k] ? "bar" : "bar lost", x: k * wide, width: 0.8 * wide, y: c > 0 ? 50 - high : 50, height: high });
    }));
  });
  const number = kept.flat().filter(Boolean).length, energy = (values) => values.reduce((sum, value) => sum + value * value, 0);
  const off = Math.sqrt(energy(x.map((value, n) => value - back[n])) / N);
  output.value = `${number} of ${bands.flat().length} coefficients kept. What comes back is off by ${off < 1e-9 ? "nothing" : off.toFixed(3)} (root mean square; the signal has ${Math.sqrt(energy(x) / N).toFixed(3)}).`;
}

function offer(level) { // a row for each band
  left.clear();
  const names = [`a${level}`, ...Array.from({ length: level }, (_, i) => `d${level - i}`)];
  rows.replaceChildren(...names.map((name, i) => {
    const row = Object.assign(document.createElement("div"), { className: "band" });
    row.innerHTML = `<label class="tick"><input type="checkbox" checked> ${name}</label><svg viewBox="0 0 1000 100" preserveAspectRatio="none" role="img" aria-label="Coefficients of ${name}"></svg>`;
    row.querySelector("input").addEventListener("change", ({ target }) => (target.checked ? left.delete(i) : left.add(i), draw()));
    return row;
  }));
}

let before;
function pointed(event) {
  const box = svg.getBoundingClientRect();
  const n = Math.min(Math.max(Math.round(((event.clientX - box.left) / box.width) * (N - 1)), 0), N - 1);
  const value = Math.min(Math.max((1 - (2 * (event.clientY - box.top)) / box.height) * 1.08, -1), 1);
  const [from, start] = before ?? [n, value];
  for (let i = Math.min(from, n); i <= Math.max(from, n); i++) x[i] = n === from ? value : start + ((value - start) * (i - from)) / (n - from);
  before = [n, value], cursor = n;
  draw();
}
svg.addEventListener("pointerdown", (event) => (svg.setPointerCapture(event.pointerId), pointed(event)));
svg.addEventListener("pointermove", (event) => before && pointed(event));
for (const end of ["pointerup", "pointercancel"]) svg.addEventListener(end, () => (before = undefined));
svg.addEventListener("keydown", (event) => {
  const [along, up] = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 0.05], ArrowDown: [0, -0.05], Home: [-N, 0], End: [N, 0] }[event.key] ?? [];
  if (along === undefined) return;
  cursor = Math.min(Math.max(cursor + along, 0), N - 1);
  x[cursor] = Math.min(Math.max(x[cursor] + up, -1), 1);
  event.preventDefault(), event.stopPropagation(); // else arrows turn the site's pages
  draw();
});
for (const name of ["focus", "blur"]) svg.addEventListener(name, draw);
const begin = () => ((x = Array.from({ length: N }, (_, n) => SIGNALS[form.elements.signal.value](n))), draw());
form.elements.wavelet.replaceChildren(...Object.keys(filters).map((name) => new Option(name, name, false, name === "bior2.8")));
form.addEventListener("input", ({ target }) => (target.name === "signal" ? begin() : draw()));
form.addEventListener("submit", (event) => event.preventDefault());
begin();
host.live = { transformed };
