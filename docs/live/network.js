// Exported networks: fetched, opened on the graphics card or in one thread a core, and asked for noise estimates. Nothing is sent anywhere.
import { classifierFree, epsOf } from "./sampler.js";

const MOST_THREADS = 4;
const known = new Map(); // what was fetched

/** A file of the site, unpacked if it is packed; `heard` is told of each piece's bytes. */
async function fetched(url, heard = () => {}) {
  const response = await fetch(url);
  if (!response.ok) throw new Error(`${url}: ${response.status}`);
  const pieces = [];
  for (let reader = response.body.getReader(), part; !(part = await reader.read()).done; ) pieces.push(part.value), heard(part.value.length);
  const blob = new Blob(pieces), [first, second] = pieces[0]; // a server may have unpacked it already
  const packed = first === 0x1f && second === 0x8b;
  return new Response(packed ? blob.stream().pipeThrough(new DecompressionStream("gzip")) : blob);
}

const once = (url, read, heard) => known.get(url) ?? known.set(url, fetched(url, heard).then(read)).get(url);

/** A JSON file beside the networks. */
export const about = (place, name, heard) => once(`${place}${name}.json.gz`, (response) => response.json(), heard);

class Thread {
  constructor(url) {
    Object.assign(this, { worker: new Worker(url, { type: "module" }), waiting: new Map(), count: 0 });
    this.worker.onmessage = ({ data: { id, value, error } }) => {
      const { resolve, reject } = this.waiting.get(id);
      this.waiting.delete(id);
      if (error) reject(new Error(error));
      else resolve(value);
    };
    this.worker.onerror = (event) => this.waiting.forEach(({ reject }) => reject(new Error(event.message || "a thread could not start")));
  }
  ask(message) {
    const id = this.count++;
    return new Promise((resolve, reject) => {
      this.waiting.set(id, { resolve, reject });
      this.worker.postMessage({ id, ...message });
    });
  }
}

const CORES = Math.min(navigator.hardwareConcurrency || 1, MOST_THREADS);
const PROCESSOR = { provider: "wasm", worker: "worker.js", runtime: "ort.wasm.gz", threads: CORES, where: CORES > 1 ? `in ${CORES} threads` : "in one thread" };
const CARD = { provider: "webgpu", worker: "worker.gpu.js", runtime: "ort.gpu.wasm.gz", threads: 1, where: "on the graphics card" };

/** Where a network can run, the best place first; `?on=cpu` or `?on=gpu` in the page's address decides instead. */
async function places() {
  const wanted = new URLSearchParams(location.search).get("on");
  if (wanted === "cpu" || !WebAssembly.Suspending) return [PROCESSOR]; // the runtime waits for the card by it
  const adapter = await navigator.gpu?.requestAdapter().catch(() => null);
  return adapter && (wanted === "gpu" || !adapter.info.isFallbackAdapter) ? [CARD, PROCESSOR] : [PROCESSOR];
}

export class Network {
  /** Open an exported network; what was opened before is closed. If it cannot run on the card, it runs on the processor. */
  static async open(place, name, heard) {
    Network.current?.close();
    const bytes = (response) => response.arrayBuffer();
    for (const one of await places()) {
      const [wasm, network] = await Promise.all([once(place + one.runtime, bytes, heard), once(`${place}${name}.onnx.gz`, bytes, heard)]);
      const opened = new Network(one.where, Array.from({ length: one.threads }, () => new Thread(place + one.worker)));
      try {
        await Promise.all(opened.threads.map((thread) => thread.ask({ provider: one.provider, wasm, network })));
        return (Network.current = opened);
      } catch (error) {
        opened.close();
        if (one === PROCESSOR) throw error;
      }
    }
  }
  constructor(where, threads) {
    Object.assign(this, { where, threads });
  }
  close() {
    this.threads.forEach(({ worker }) => worker.terminate());
  }
  /** What it says besides of one item of `shape`: its "mean" or its "factor". */
  async said(wanted, shape, condition) {
    const size = shape.reduce((x, z) => x * z, 1), feeds = { y_t: ["float32", new Float32Array(size), [1, ...shape]], t: ["int64", BigInt64Array.of(1n), [1]], ...condition };
    return this.threads[0].ask({ feeds, wanted });
  }
  /** The network's output for items of `shape`; the threads share them out. */
  async output(y, shape, t, condition, told) {
    const size = shape.reduce((x, z) => x * z, 1), items = y.length / size, share = Math.ceil(items / this.threads.length);
    const parts = this.threads.map((thread, i) => {
      const [from, to] = [i * share, Math.min((i + 1) * share, items)];
      const feeds = {
        y_t: ["float32", Float32Array.from(y.subarray(from * size, to * size)), [to - from, ...shape]], t: ["int64", BigInt64Array.of(BigInt(t)), [1]],
        ...(told && { told: ["float32", told.slice(from, to), [to - from]] }), ...condition,
      };
      return to > from ? thread.ask({ feeds, wanted: "output" }) : new Float32Array();
    });
    const found = await Promise.all(parts), out = new Float32Array(y.length);
    found.reduce((at, part) => (out.set(part, at), at + part.length), 0);
    return out;
  }
  /** (y_t, t) -> eps, guided by weight w; `neutral` is the weight that leaves the conditional estimate alone. */
  denoiser({ prediction, alpha_bar, inputs, sampling }, shape, condition, w, form) {
    const neutral = form === "eq7" ? 0 : 1, lowest = (sampling.guidance_above ?? 0) * alpha_bar.length;
    const of = { y0: epsOf, v: (y, said, a) => y.map((value, i) => Math.sqrt(a) * said[i] + Math.sqrt(1 - a) * value) };
    const eps = (said, y, t) => (prediction === "eps" ? said : of[prediction](y, said, alpha_bar[t]));
    return async (y, t) => {
      const items = y.length / shape.reduce((x, z) => x * z, 1), ones = inputs.includes("told") ? new Float32Array(items).fill(1) : undefined;
      if (w === neutral || !ones || t < lowest) return eps(await this.output(y, shape, t, condition, ones), y, t);
      const both = new Float64Array(2 * y.length), told = new Float32Array(2 * items);
      both.set(y), both.set(y, y.length), told.set(ones);
      const said = await this.output(both, shape, t, condition, told);
      return classifierFree(eps(said.slice(0, y.length), y, t), eps(said.slice(y.length), y, t), w, form);
    };
  }
}
