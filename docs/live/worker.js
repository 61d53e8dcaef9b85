// A network in a thread of its own. Pages on a plain server may not share memory between threads, so each has its own copy.
// It is bundled twice: with the runtime of processors, and with that of graphics cards.
import * as ort from "runtime";

let session;

async function answer({ provider, wasm, network, feeds, wanted }) {
  if (network) {
    Object.assign(ort.env.wasm, { numThreads: 1, wasmBinary: wasm });
    ort.env.logLevel = "error";
    session = await ort.InferenceSession.create(network, { executionProviders: [provider], logSeverityLevel: 3 });
    return undefined;
  }
  const tensors = Object.entries(feeds).map(([name, [type, values, shape]]) => [name, new ort.Tensor(type, values, shape)]);
  const found = await session.run(Object.fromEntries(tensors), [wanted]);
  return Float32Array.from(found[wanted].data);
}

onmessage = async ({ data }) => {
  try {
    postMessage({ id: data.id, value: await answer(data) });
  } catch (error) {
    postMessage({ id: data.id, error: String(error?.message ?? error) });
  }
};
