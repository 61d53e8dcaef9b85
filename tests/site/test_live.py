"""The live pages calculate what Python calculates, on the same noise; they can be used by keyboard, and load little."""

from __future__ import annotations

import copy
from contextlib import nullcontext

import numpy as np
import pytest
import pywt
import torch

import mwlib as mw
from mwlib.body.motion import Motion
from mwlib.body.standing import legs, standing
from mwlib.course.live import STEPS, WAVELETS
from mwlib.diffusion import WindowNoise, alpha_bar, ddim, ddim_indices, eps_of, posterior_mean
from mwlib.inbetweening.windows import given
from mwlib.prediction.guidance import guided
from mwlib.prediction.predictor import temperatures
from mwlib.synthetic.acts import TIMED, captioned_positions, usual_times
from mwlib.synthetic.sentences import examples
from mwlib.synthetic.sentences_typed import as_learnt, claims
from mwlib.text_to_motion.motions import fused_joints, steady_bones
from tests.site.conftest import SITE

pytestmark = pytest.mark.usefixtures("unchecked")

MOST_BYTES = 15_000_000
NEAR = 1e-4
OF = {"cpu": 1, "gpu": 10}  # a card, even of software, rounds more than a processor
SIZES = """() => [...performance.getEntriesByType('resource'), ...performance.getEntriesByType('navigation')]
  .reduce((sum, entry) => sum + entry.transferSize, 0)"""
FUTURES = """async ([people, window, asked, noise]) => {
  const host = document.querySelector('#live-futures'), form = host.querySelector('form');
  form.elements.people.value = people;
  form.elements.people.dispatchEvent(new Event('change'));
  form.elements.window.value = window;
  const chosen = host.live.chosen(), found = await host.live.sample(chosen, asked, () => Float32Array.from(noise));
  return { x: [...chosen.x], model: chosen.model, futures: found.futures.map((one) => [...one]), errors: found.errors };
}"""
SENTENCES = """async ([text, asked, noise]) => {
  const { sample } = document.querySelector('#live-sentences').live;
  let at = 0;
  const found = await sample(text, asked, () => Float32Array.from(noise[at++]));
  return { features: found.features.map((one) => [...one]), joints: found.joints.map((one) => [...one]) };
}"""
BETWEEN = """async ([poses, T, asked, noise]) => {
  const host = document.querySelector('#live-between'), { from, to, start, end, turn } = host.querySelector('form').elements;
  for (const [field, value] of [[from, poses[0]], [start, poses[1]], [to, poses[2]], [end, poses[3]], [turn, poses[4]]]) {
    field.value = value;
    field.dispatchEvent(new Event('input', { bubbles: true }));
  }
  const four = host.live.given(), found = await host.live.sample(four, T, asked, () => Float32Array.from(noise));
  const { motions, joints } = found, plain = (parts) => parts.map((one) => [...one]);
  return { four: plain(four), motions: plain(motions), joints: plain(joints) };
}"""
READ = """async (texts) => {
  const { reader } = await document.querySelector('#live-sentences').live.tables();
  return texts.map((text) => {
    try {
      const { text: said, actions, isLearnt } = reader.read(text);
      return [said, actions, isLearnt, reader.claims(said), reader.time(said) ?? null];
    } catch { return null; }
  });
}"""
TYPED = (
    """
walk forward|He walked slow, then he's turning left!|she jumps 3 times|jogging fast
a man is slowly walking and then waves|raise your right hand|lifts both arms|they don't run|nobody moves
a person does not move|walk, run and jump and kick|wave|stop|der Mann läuft|ein Mensch tanzt Tango|идёт человек
the lady picks up something|I'm sitting down|turn right and walk|rotate to the left|walks backwards quickly
punch 2 times with the left fist|a guy hops upwards|two steps|anticlockwise circle|someone’s jumping
constructor valueOf|walk in a circle
""".strip()
    .replace("\n", "|")
    .split("|")
)


class Given(WindowNoise):
    """The one draw that the page was given."""

    def __init__(self, noise: torch.Tensor) -> None:
        super().__init__(0, [0], tuple(noise.shape))
        self.noise = noise[None]

    def __call__(self) -> torch.Tensor:
        return self.noise


@pytest.fixture(scope="module")
def opened(browser, address):
    """Opens a live page; says what went wrong."""
    page = browser.new_page()
    page.set_default_timeout(180_000)
    yield lambda name, on="cpu": page.goto(f"{address}live/{name}.html?on={on}") and page
    page.close()


@pytest.mark.parametrize(
    ("people", "window", "guidance", "on"), [(0, 0, 0.0, "cpu"), (0, 4, 1.5, "cpu"), (1, 1, 0.0, "cpu"), (0, 4, 1.5, "gpu")]
)
def test_futures_are_pythons(opened, people, window, guidance, on):
    page, generator = opened("futures", on), torch.Generator().manual_seed(people)
    noise = torch.randn(3, 16, 192, generator=generator)
    asked = {"samples": 3, "steps": 8, "guidance": guidance, "temperature": 1.1}
    found = page.evaluate(FUTURES, [str(people), str(window), asked, noise.flatten().tolist()])
    model = mw.load_run(found["model"]).with_sampling(ddim_steps=8, guidance_weight=guidance, temperature=1.1)
    model.net = copy.deepcopy(model.net).double()  # where sampling begins, 1 / sqrt(alpha_bar) multiplies rounding by thousands
    x = torch.tensor(found["x"], dtype=torch.float64).reshape(1, 125, 48)
    with torch.inference_mode():
        draw, chosen = Given(noise.double()), model.sampling
        branches = guided(model.branches(x[:, :25]), model.alpha_bar, weight=guidance, form=chosen.guidance_form)
        start = draw() * temperatures(3, 1.1, chosen.temperature_spread)[:, None, None]
        *_, last = ddim(branches, start, model.alpha_bar, model.indices())
        expected = model.decode(last.y, x[:, :25])
    assert np.abs(np.array(found["futures"]).reshape(3, 100, 48) - expected[0].numpy()).max() < OF[on] * NEAR
    assert min(found["errors"]) == pytest.approx(float(mw.metrics.ade(expected, x[:, 25:])), abs=OF[on] * NEAR)


POSES = [((0, 40, 0, 80, 0), 5), ((0, 60, 2, 90, 60), 30), ((6, 20, 5, 40, -150), 90)]


@pytest.mark.parametrize(("poses", "between", "on"), [*[(*one, "cpu") for one in POSES], (*POSES[1], "gpu")])
def test_motions_between_two_poses_are_pythons(opened, poses, between, on):
    page, model, T = opened("between", on), mw.load_run("inbetween").with_sampling(temperature=0.5), between + 4
    rows = min(32, between)
    noise = torch.randn(2, rows, 51, generator=torch.Generator().manual_seed(between))
    asked = {"samples": 2, "temperature": 0.5}
    found = page.evaluate(BETWEEN, [[str(value) for value in poses], between + 2, asked, noise.flatten().tolist()])
    four = torch.tensor(found["four"], dtype=torch.float64)
    x = torch.cat([four[:2], four[1:2].repeat(between, 1), four[2:]])
    model.net = copy.deepcopy(model.net).double()  # where sampling begins, 1 / sqrt(alpha_bar) multiplies rounding by thousands
    place = model.space.placement(x, torch.zeros(0, 3), 1)
    with torch.inference_mode():
        states = model._sample(model.space.seen_from(x, place)[None], given(T, 2, 2), Given(noise.double()))[0]
    expected = torch.stack([model.space.placed(each, place) for each in states])[:, 1:-1]
    assert np.abs(np.array(found["motions"]).reshape(2, between + 2, 51) - expected.numpy()).max() < OF[on] * NEAR
    bodies, joints = model.space.bodies, model.space.positions(expected, torch.zeros(0, 3)).numpy()
    below = [foot for _, _, foot in legs(bodies.skeleton)]
    floor = float(model.space.positions(four, torch.zeros(0, 3))[:, below, 2].min())
    held = np.stack([standing(Motion(each, bodies.fps, bodies.skeleton, up="z"), floor).positions for each in joints])
    assert (
        np.abs(np.array(found["joints"]).reshape(held.shape) - held).max() < 10 * OF[on] * NEAR
    )  # a foot may begin to stand at a bound


@pytest.mark.parametrize("on", ["cpu", "gpu"])
def test_sentences_are_pythons(opened, on):
    page, model, text = opened("sentences", on), mw.load_run("sentences"), "a person walks in a circle to the left xyz"
    noise = torch.randn(5, 2, 48, 263, generator=torch.Generator().manual_seed(0))
    asked = {"samples": 2, "seconds": 2.4, "steps": 5, "guidance": 2.5}
    found = page.evaluate(SENTENCES, [text, asked, noise.flatten(1).tolist()])
    draws = iter(noise)
    with torch.inference_mode():
        denoise = model._denoise([text] * 2, torch.ones(2, 48, dtype=torch.bool))
        steps = ddim_indices(len(model.alpha_bar), 5, "trailing")
        *_, last = posterior_mean(denoise, next(draws), model.alpha_bar, steps, noise=lambda: next(draws))
        raw = model.statistics.denormalise(last.y)
    apart = np.abs(np.array(found["features"]).reshape(2, 48, 263) - raw.numpy()).max()
    assert apart < 5 * OF[on] * NEAR  # a wide network, and guidance, which exaggerates
    skeleton = model.layout.skeleton
    joints = torch.stack([steady_bones(fused_joints(one.double(), model.layout), skeleton) for one in raw])
    assert (
        np.abs(np.array(found["joints"]).reshape(2, 48, 22, 3) - joints.numpy()).max() < 10 * OF[on] * NEAR
    )  # of a path of metres


def test_sentences_are_read_as_python_reads_them(opened):
    made = [caption for clip in captioned_positions(clips=20) for caption in clip.captions]
    texts, times = [*examples().values(), *made, *TYPED], usual_times()

    def read(text):
        try:
            said = as_learnt(text)
        except ValueError:
            return None
        told = claims(said.text)
        action = "backward" if told.get("direction") == "backward" else told.get("action", "")
        one, two = [action, *(str(told[name]) for name in TIMED if name in told)], f"{action} then {told.get('then')}"
        return [said.text, [*said.actions], said.is_learnt, told, times.get(two if "then" in told else " ".join(one))]

    assert opened("sentences").evaluate(READ, texts) == [read(text) for text in texts]


def test_the_wavelet_transform_is_pywavelets(opened):
    page, x = opened("wavelet"), np.random.default_rng(0).normal(size=37)
    ask = "([x, asked]) => document.querySelector('#live-wavelet').live.transformed(x, asked, new Set())"
    for wavelet in WAVELETS:
        for mode, level in (("zero", 1), ("zero", 3), ("symmetric", 2), ("symmetric", 4)):
            found = page.evaluate(ask, [x.tolist(), {"wavelet": wavelet, "mode": mode, "level": level, "share": 100}])
            with pytest.warns(UserWarning) if level > pywt.dwt_max_level(37, wavelet) else nullcontext():
                expected = pywt.wavedec(x, wavelet, mode, level)
            assert all(np.allclose(one, other, atol=1e-9) for one, other in zip(found["bands"], expected, strict=True))
            assert np.allclose(found["back"], x, atol=1e-9)


@pytest.mark.parametrize(("sampler", "schedule", "steps"), [("ddim", "cosine", 16), ("ddpm", "linear", 50), ("eq6", "sqrt", 100)])
def test_paths_of_one_number_are_pythons(opened, sampler, schedule, steps):
    noise = torch.randn(steps + 1, 20, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    ask = """async ([asked, noise]) => {
      let at = 0;
      const draw = () => Float64Array.from(noise[at++]), start = draw();
      return [...(await document.querySelector('#live-number').live.walked(asked, start, draw)).states.at(-1)];
    }"""
    asked = {"sampler": sampler, "schedule": schedule, "steps": steps, "left": 0.65}
    found = opened("number").evaluate(ask, [asked, noise.tolist()])
    a, centres, weights, draws = alpha_bar(schedule, STEPS), torch.tensor([-1.0, 0.8]), torch.tensor([0.35, 0.65]), iter(noise)

    def denoise(y, t):
        variance, away = a[t] * 0.15**2 + 1 - a[t], y[:, None] - a[t].sqrt() * centres
        likely = torch.softmax(weights.log() - away**2 / (2 * variance), dim=-1)
        return eps_of(y, (likely * (centres + a[t].sqrt() * 0.15**2 / variance * away)).sum(-1), a[t])

    indices, start = ddim_indices(STEPS, steps, "trailing"), next(draws)
    run = ddim(denoise, start, a, indices) if sampler == "ddim" else posterior_mean(
        denoise, start, a, indices, noise=(lambda: next(draws)) if sampler == "ddpm" else None
    )  # fmt: skip
    *_, last = run
    assert np.abs(np.array(found) - last.y.numpy()).max() < 1e-3  # schedules come with six digits


@pytest.mark.parametrize("name", ["futures", "between", "sentences"])
def test_a_page_draws_when_asked_by_keyboard(page, address, name, record_property):
    page.troubles.clear()
    page.goto(f"{address}live/{name}.html")
    page.locator("[name=samples]").fill("20" if name == "futures" else "2")
    page.locator("[name=samples]").press("Enter")
    output = page.locator("output.said").last
    page.wait_for_function("node => / in [0-9.]+ s/.test(node.textContent)", arg=output.element_handle())
    page.locator("form button").press("Enter")
    page.wait_for_function("node => /noise 2/.test(node.textContent)", arg=output.element_handle())
    record_property("said", output.text_content())
    print(name, page.viewport_size, output.text_content(), f"{page.evaluate(SIZES) / 1e6:.2f} MB")
    assert page.locator(".stage canvas").count() == 1 and page.evaluate(SIZES) < MOST_BYTES
    assert page.troubles == []
    unnamed = page.evaluate("[...document.querySelectorAll('.live :is(input, select)')].filter(f => !f.labels?.length).length")
    assert unnamed == 0


def test_the_motion_follows_poses_moved_by_pointer_and_keys(page, address):
    page.troubles.clear()
    page.goto(f"{address}live/between.html")
    page.locator(".live button[type=submit]").click()
    output, plan = page.locator("output.said").last, page.locator(".live .plan")
    page.wait_for_function("node => / in [0-9.]+ s/.test(node.textContent)", arg=output.element_handle())

    def follows(act, how_far):
        before = plan.get_attribute("aria-description")
        way = plan.locator("polyline").first.get_attribute("points")
        act()
        page.wait_for_function(
            "([plan, way]) => plan.querySelector('polyline')?.getAttribute('points') !== way", arg=[plan.element_handle(), way]
        )
        assert plan.get_attribute("aria-description") != before or not how_far

    plan.scroll_into_view_if_needed()
    follows(lambda: plan.press("ArrowRight"), 0.1)
    follows(lambda: plan.press("PageUp"), 15)
    follows(lambda: page.locator("[name=gap]").press("ArrowRight"), 0)
    follows(lambda: page.locator("[name=end]").press("ArrowRight"), 0.01)
    box = plan.bounding_box()
    page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
    page.mouse.down()
    follows(lambda: page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 4, steps=3), 1)
    page.mouse.up()
    assert "to the left" in plan.get_attribute("aria-description")
    page.locator("[name=gap]").fill("5")
    plan.press("ArrowRight")
    page.mouse.click(box["x"] + 0.97 * box["width"], box["y"] + box["height"] / 2)
    page.wait_for_selector("output.warned")
    assert "nobody is faster than 12" in output.text_content() and page.troubles == []


def test_unknown_words_are_marked_while_typing(page, address):
    page.goto(f"{address}live/sentences.html")
    page.locator("[name=text]").fill("a person walks zanily forward")
    page.wait_for_selector("#live-read mark")
    assert page.locator("#live-read mark").all_text_contents() == ["zanily"]
    page.locator("[name=text]").fill("nobody walks")
    page.wait_for_selector("#live-read.warned")
    assert "no denial" in page.locator("#live-read").text_content()


def test_a_signal_is_drawn_by_pointer_and_keys(page, address):
    page.goto(f"{address}live/wavelet.html")
    svg = page.locator(".live .signal")
    svg.scroll_into_view_if_needed()
    box, before = svg.bounding_box(), svg.inner_html()
    page.mouse.move(box["x"] + 50, box["y"] + 30)
    page.mouse.down()
    page.mouse.move(box["x"] + 120, box["y"] + 150, steps=4)
    page.mouse.up()
    drawn = svg.inner_html()
    assert drawn != before
    svg.press("ArrowRight")
    svg.press("ArrowUp")
    assert page.url.endswith("wavelet.html")
    assert svg.inner_html() != drawn and "sample" in svg.get_attribute("aria-valuetext")
    page.locator(".band input").last.uncheck()
    assert "off by nothing" not in page.locator("output.said").text_content()


@pytest.mark.parametrize("name", ["wavelet", "number"])
def test_a_page_without_a_model_opens_from_a_file(browser, name):
    page, errors = browser.new_page(), []
    page.on("pageerror", lambda error: errors.append(str(error)))
    page.goto((SITE / "live" / f"{name}.html").as_uri())
    page.wait_for_function("document.querySelector('output.said').textContent.length > 40")
    assert errors == []
    page.close()
