"""Euler angles and quaternions against SciPy; signs, angles and twists that go on in time; gradients."""

from __future__ import annotations

from itertools import permutations

import numpy as np
import pytest
import torch
from scipy.spatial.transform import Rotation, Slerp

from mwlib.body import rotation

RNG = np.random.default_rng(0)
ORDERS = ["".join(axes) for n in (1, 2, 3) for axes in permutations("xyz", n)]


def turns(*shape: int) -> torch.Tensor:
    """Random unit quaternions."""
    return unit(RNG.normal(size=(*shape, 4)))


def unit(values: np.ndarray) -> torch.Tensor:
    return torch.nn.functional.normalize(torch.from_numpy(values), dim=-1)


def scipy(q: torch.Tensor) -> Rotation:
    return Rotation.from_quat(q.numpy().reshape(-1, 4)[:, [1, 2, 3, 0]])


def same_turn(a: np.ndarray, b: np.ndarray, atol: float = 1e-12) -> None:
    np.testing.assert_allclose(np.abs(np.sum(a * b, axis=-1)), 1.0, atol=atol)


@pytest.mark.parametrize("axes", ORDERS)
def test_euler_quaternions_are_scipys_and_those_of_the_matrices(axes):
    angles = RNG.uniform(-7, 7, (50, len(axes)))
    found = rotation.euler_quaternions(axes, angles)
    expected = Rotation.from_euler(axes.upper(), angles).as_quat()[:, [3, 0, 1, 2]]
    same_turn(found, expected)
    matrices = rotation.matrix(torch.from_numpy(found)).numpy()
    np.testing.assert_allclose(matrices, rotation.euler_matrices(axes, angles), atol=1e-12)


def test_no_axis_is_no_turn():
    np.testing.assert_array_equal(rotation.euler_quaternions("", np.empty((2, 3, 0))), np.tile([1.0, 0, 0, 0], (2, 3, 1)))
    assert rotation.euler_angles("", np.tile([1.0, 0, 0, 0], (4, 1))).shape == (4, 0)


@pytest.mark.parametrize("axes", ORDERS)
def test_euler_angles_come_back_beyond_half_turns_and_without_jumps(axes):
    time = np.linspace(0, 1, 200)[:, None, None]
    angles = time * RNG.uniform(-9, 9, (2, len(axes))) + RNG.uniform(-0.5, 0.5, (2, len(axes)))  # past the gimbal lock and on
    quaternions = rotation.euler_quaternions(axes, angles)
    found = rotation.euler_angles(axes, quaternions)
    same_turn(rotation.euler_quaternions(axes, found), quaternions)
    assert np.abs(np.diff(found, axis=0)).max() < 0.2
    assert np.abs(found[0]).max() <= np.pi
    np.testing.assert_allclose(np.ptp(found, axis=0), np.ptp(angles, axis=0), atol=1e-6)


@pytest.mark.parametrize("axes", [axes for axes in ORDERS if len(axes) == 3])
def test_euler_angles_at_gimbal_lock_make_the_same_turn(axes):
    lock = np.pi / 2
    angles = np.array([[0.3, lock, 0.4], [0.3, -lock, 0.4], [0.3, lock + 1e-8, -2.0], [0.3, lock - 1e-6, 3.0]])
    quaternions = rotation.euler_quaternions(axes, angles)
    same_turn(rotation.euler_quaternions(axes, rotation.euler_angles(axes, quaternions)), quaternions, atol=1e-13)


@pytest.mark.parametrize("axes", [axes for axes in ORDERS if len(axes) == 2])
def test_two_angles_survive_rounding_at_a_half_turn(axes):
    quaternions = rotation.euler_quaternions(axes, np.array([[0.7, np.pi], [np.pi, 0.7], [-2.0, -np.pi]]))
    quaternions += RNG.normal(0, 5e-8, quaternions.shape)  # as single precision does where the numbers are not tiny
    found = rotation.euler_quaternions(axes, rotation.euler_angles(axes, quaternions))
    apart = np.minimum(*(np.linalg.norm(found - sign * quaternions, axis=-1) for sign in (1, -1)))
    assert apart.max() < 5e-7


def test_products_rotations_and_matrices_are_scipys():
    a, b, v = turns(5, 7), turns(5, 7), torch.from_numpy(RNG.normal(size=(5, 7, 3)))
    product = rotation.multiply(a, b)
    np.testing.assert_allclose(scipy(product).as_matrix(), (scipy(a) * scipy(b)).as_matrix(), atol=1e-12)
    np.testing.assert_allclose(rotation.rotate(a, v).numpy().reshape(-1, 3), scipy(a).apply(v.numpy().reshape(-1, 3)), atol=1e-12)
    np.testing.assert_allclose(rotation.matrix(a).numpy().reshape(-1, 3, 3), scipy(a).as_matrix(), atol=1e-12)
    torch.testing.assert_close(rotation.rotate(rotation.inverse(a), rotation.rotate(a, v)), v)
    torch.testing.assert_close(rotation.rotate(a[:, :1], v), rotation.rotate(a[:, :1].expand(5, 7, 4), v))  # axes broadcast
    np.testing.assert_allclose(rotation.multiply(a[0], b[0]).numpy(), product[0].numpy())


def test_slerp_is_scipys_along_the_shorter_way():
    a, b = turns(20), turns(20)
    for share in (0.0, 0.3, 1.0):
        found = rotation.slerp(a, b, torch.full((20,), share))
        expected = [Slerp([0, 1], scipy(torch.stack(ends)))(share).as_quat()[[3, 0, 1, 2]] for ends in zip(a, b, strict=True)]
        same_turn(found.numpy(), np.array(expected))
    torch.testing.assert_close(rotation.slerp(a, b, torch.zeros(20)), a)
    x = torch.tensor([[1.0, 0, 0, 0], [0.5**0.5, 0.5**0.5, 0, 0]], dtype=torch.float64)
    for end in (x[1], -x[1]):
        half = rotation.slerp(x[0], end, torch.tensor(0.5))
        torch.testing.assert_close(half, x.new_tensor([0.92388, 0.382683, 0, 0]), atol=1e-6, rtol=0)


def test_slerp_between_equal_and_nearly_equal_turns():
    a = turns(3)
    torch.testing.assert_close(rotation.slerp(a, a, torch.full((3,), 0.7)), a)
    near = unit((a + 1e-5 * torch.from_numpy(RNG.normal(size=(3, 4)))).numpy())
    half = rotation.slerp(a, near, torch.full((3,), 0.5))
    torch.testing.assert_close(half, torch.nn.functional.normalize(a + near, dim=-1), atol=1e-12, rtol=0)
    a.requires_grad_()
    rotation.slerp(a, a.detach().clone(), torch.full((3,), 0.5)).sum().backward()
    assert torch.isfinite(a.grad).all()


def test_continuous_changes_signs_only_and_leaves_none_opposite():
    angles = np.cumsum(RNG.uniform(-0.5, 0.7, (300, 4, 3)), axis=0)
    smooth = torch.from_numpy(rotation.euler_quaternions("zyx", angles))
    flipped = smooth * torch.from_numpy(RNG.choice([-1.0, 1.0], (300, 4, 1)))
    found = rotation.continuous(flipped)
    assert (found[1:] * found[:-1]).sum(dim=-1).min() > 0
    torch.testing.assert_close(found.abs(), smooth.abs())
    torch.testing.assert_close(found[0], flipped[0])
    torch.testing.assert_close(rotation.continuous(torch.stack([flipped, -flipped])), torch.stack([found, -found]))


def test_shortest_arcs_reach_their_end_by_the_smallest_turn():
    a, b = (torch.from_numpy(RNG.normal(size=(50, 3))) for _ in "ab")
    q = rotation.shortest_arc(a, b)
    torch.testing.assert_close(rotation.rotate(q, a / a.norm(dim=-1, keepdim=True)), b / b.norm(dim=-1, keepdim=True))
    cosine = torch.nn.functional.cosine_similarity(a, b, dim=-1)
    np.testing.assert_allclose(scipy(q).magnitude(), np.arccos(cosine.numpy()), atol=1e-7)
    back = rotation.shortest_arc(a, -a)
    torch.testing.assert_close(rotation.rotate(back, a), -a)
    none = a.new_tensor([1.0, 0, 0, 0]).expand(50, 4)
    torch.testing.assert_close(rotation.shortest_arc(a, 3 * a), none)
    torch.testing.assert_close(rotation.shortest_arc(a, torch.zeros_like(a)), none)


@pytest.mark.parametrize("function", ["multiply", "rotate", "matrix", "slerp", "shortest_arc", "continuous"])
def test_gradients(function):
    q = [turns(3, 2).requires_grad_() for _ in "ab"]
    v = [torch.from_numpy(RNG.normal(size=(3, 2, 3))).requires_grad_() for _ in "ab"]
    share = torch.full((3, 2), 0.3, dtype=torch.float64, requires_grad=True)
    arguments = {
        "multiply": q, "rotate": (q[0], v[0]), "matrix": q[:1], "slerp": (*q, share), "shortest_arc": v, "continuous": q[:1],
    }  # fmt: skip
    assert torch.autograd.gradcheck(getattr(rotation, function), tuple(arguments[function]))


PRECISIONS = [(torch.float32, 1e-5), (torch.float64, 1e-12)]


@pytest.mark.parametrize(("dtype", "atol"), PRECISIONS)
def test_six_are_the_first_two_columns_and_lead_back(dtype, atol):
    q = turns(200, 3).to(dtype)
    columns = scipy(q.double()).as_matrix()[:, :, :2].transpose(0, 2, 1).reshape(200, 3, 6)
    np.testing.assert_allclose(rotation.six(q).numpy(), columns, atol=atol)
    back = rotation.from_six(rotation.six(q))
    assert back.dtype == dtype
    np.testing.assert_allclose((back * q).sum(dim=-1).abs().numpy(), 1.0, atol=atol)
    torch.testing.assert_close(rotation.six(-q), rotation.six(q))
    torch.testing.assert_close(rotation.six(back), rotation.six(q), atol=atol, rtol=0)


def test_six_numbers_of_no_rotation_become_gram_and_schmidts():
    numbers = torch.from_numpy(RNG.normal(size=(50, 6)))
    found = scipy(rotation.from_six(numbers)).as_matrix()
    x, across = numbers[:, :3].numpy(), numbers[:, 3:].numpy()
    x = x / np.linalg.norm(x, axis=-1, keepdims=True)
    y = across - np.sum(x * across, axis=-1, keepdims=True) * x
    y = y / np.linalg.norm(y, axis=-1, keepdims=True)
    np.testing.assert_allclose(found, np.stack([x, y, np.cross(x, y)], axis=-1), atol=1e-12)
    scale = torch.from_numpy(RNG.uniform(0.1, 9, (50, 2))).repeat_interleave(3, dim=1)
    torch.testing.assert_close(rotation.from_six(scale * numbers), rotation.from_six(numbers))


def half_turns(dtype: torch.dtype) -> torch.Tensor:
    """Quaternions at and near half turns about the axes and about what lies between them; and no turn."""
    axes = unit(np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [0, -1, 1], [1, 2, 3], [-1, 0, 1e-4]], float))
    angle = torch.from_numpy(np.array([0.0, 1e-8, 1e-4, np.pi - 1e-3, np.pi - 1e-8, np.pi, np.pi + 1e-6]))[:, None, None]
    return torch.cat([torch.cos(angle / 2).expand(7, 7, 1), torch.sin(angle / 2) * axes], dim=-1).to(dtype)


@pytest.mark.parametrize(("dtype", "atol"), PRECISIONS)
def test_quaternions_of_matrices_at_half_turns(dtype, atol):
    for q in (half_turns(dtype), turns(300).to(dtype)):
        found = rotation.from_matrix(rotation.matrix(q))
        np.testing.assert_allclose(found.norm(dim=-1).numpy(), 1.0, atol=1e-6)
        apart = torch.minimum((found - q).norm(dim=-1), (found + q).norm(dim=-1))
        assert apart.max() < 4 * atol
    mostly_w = torch.nn.functional.normalize(turns(100) * 0.3 + torch.tensor([1.0, 0, 0, 0]), dim=-1)
    torch.testing.assert_close(rotation.from_matrix(rotation.matrix(mostly_w)), mostly_w)  # not its negative


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_gradients_stay_finite_and_right_at_half_turns(dtype):
    numbers = rotation.six(half_turns(dtype)).requires_grad_()
    weights = torch.randn(4, generator=torch.Generator().manual_seed(0)).to(dtype)
    (gradient,) = torch.autograd.grad((rotation.from_six(numbers) * weights).sum(), numbers)
    assert gradient.isfinite().all() and gradient.abs().max() < 10
    away = rotation.six(turns(4)).requires_grad_()
    assert torch.autograd.gradcheck(rotation.from_six, (away,))
    matrices = rotation.matrix(turns(4)).requires_grad_()
    assert torch.autograd.gradcheck(rotation.from_matrix, (matrices,))


def test_the_smallest_turn_between_nearly_opposite_vectors():
    a = unit(torch.randn(200, 3, generator=torch.Generator().manual_seed(0)).numpy()).float()
    for off in (0.0, 1e-7, 1e-5, 1e-3):
        b = torch.nn.functional.normalize(-a + off * torch.randn(200, 3, generator=torch.Generator().manual_seed(1)), dim=-1)
        q = rotation.shortest_arc(a, b)
        assert q.dtype == torch.float32 and (rotation.rotate(q, a) - b).norm(dim=-1).max() < 2e-6
