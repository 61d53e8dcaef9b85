"""The player as a widget of a running notebook: Python sees which frame is shown, and can change it."""

import anywidget
import traitlets

from mwlib.plots.playing import LOAD

# Ten messages a second at most, and none that only repeats what Python said.
RENDER = """
async function render({ model, el }) {
  const { mount } = await load(model.get("key"), model.get("bundle"));
  const names = ["frame", "playing", "speed"];
  let told = 0, waiting;
  const tell = (now) => {
    clearTimeout(waiting);
    const news = names.filter((name) => model.get(name) !== now[name]);
    if (!news.length) return;
    if (performance.now() - told < 100) return void (waiting = setTimeout(tell, 100, now));
    told = performance.now();
    for (const name of news) model.set(name, now[name]);
    model.save_changes();
  };
  const player = mount(el, model.get("payload"), tell);
  model.on("change:frame", () => player.playing || player.seek(model.get("frame")));
  model.on("change:playing", () => player.playing === model.get("playing") || player.play(model.get("playing")));
  model.on("change:speed", () => player.rate(model.get("speed")));
  return () => (clearTimeout(waiting), player.destroy());
}
export default { render };
"""


class PlayerWidget(anywidget.AnyWidget):
    """What `Player.widget` gives.

    Attributes:
        frame: shown now; setting it moves a player that is paused.
        playing: setting it starts or pauses the player.
        speed: times true speed.
    """

    _esm = LOAD + RENDER
    key = traitlets.Unicode().tag(sync=True)
    bundle = traitlets.Unicode().tag(sync=True)
    payload = traitlets.Dict().tag(sync=True)
    frame = traitlets.Int(0).tag(sync=True)
    playing = traitlets.Bool(False).tag(sync=True)
    speed = traitlets.Float(1.0).tag(sync=True)
