"""Scatter: polish against quadrature of its BSDF; dust against FFTs, quadrature and Mie."""

import math

import numpy as np
import pytest
from k_correlation import bsdf_k
from scipy.integrate import dblquad, quad
from scipy.special import j1, spherical_jn, spherical_yn

from vrscan.data.arrays import Floats
from vrscan.data.config import Config
from vrscan.data.errors import InputError
from vrscan.scene.description import Description
from vrscan.scene.image import Singles
from vrscan.scene.light import Light
from vrscan.scene.render import Renderer
from vrscan.scene.scatter import (
    disc_within,
    emitter,
    halo_weights,
    intensity,
    receiver,
    rough_within,
    slit_within,
)
from vrscan.scene.stray import (
    Dust,
    Lens,
    Mirror,
    Polish,
    Stray,
    covered_share,
    obscured_share,
    particles,
    soiled,
)
from vrscan.scene.surface import tis
from vrscan.scene.timeline import Timeline

WAVELENGTH_NM = 658.0
CLEAN = Polish(roughness_nm=0.0)


def _one_lever(polish: Polish) -> Stray:
    """Only the front window scatters: two faces, a focal length from the sensor."""
    return Stray(enabled=["window", "halo"], lens=Lens(kind="thin"), polish=polish)


def _density(r: float, polish: Polish, index: float) -> float:
    """Irradiance at r px for unit light, from the BSDF of the scatter, per px^2."""
    lever, pitch = 25.0, 0.007
    turn = math.atan(r * pitch / lever)
    scatter = bsdf_k(
        math.sin(turn),
        1.0,
        1.0,
        sigma_nm=polish.roughness_nm,
        wavelength_nm=WAVELENGTH_NM,
        length_um=1e3 * polish.length_mm,
        slope=polish.slope,
        index_step=index - 1.0,
    )
    # The BSDF without its cosine is per area of the disc of direction cosines, and that is
    # cos d omega = cos^4 dA / lever^2.
    return 2.0 * float(scatter) * math.cos(turn) ** 4 * (pitch / lever) ** 2


@pytest.mark.parametrize("polish", [Polish(), Polish(slope=1.7, length_mm=0.3, roughness_nm=5.0)])
def test_the_halo_of_a_pixel_is_the_bsdf_over_its_area(polish: Polish) -> None:
    stray = _one_lever(polish)
    index = stray.window.index
    halo = halo_weights(1500, receiver(stray))
    for px in (0, 1, 2, 10, 100, 1200):
        area, _ = dblquad(
            lambda y, x: _density(math.hypot(x, y), polish, index),
            px - 0.5,
            px + 0.5,
            -0.5,
            0.5,
            epsrel=1e-5,
        )
        print(f"{px:5d} px: {halo.weights[px]:.4e}, integral {area:.4e}")
        assert halo.weights[px] == pytest.approx(area, rel=0.003)
    energy = 2.0 * math.pi * quad(lambda r: r * _density(r, polish, index), 0.0, 50.0)[0]
    energy += (
        2.0
        * math.pi
        * quad(
            lambda t: math.exp(2.0 * t) * _density(math.exp(t), polish, index),
            math.log(50.0),
            math.log(1e9),
            limit=500,
        )[0]
    )
    expected = 2.0 * float(tis(polish.roughness_nm, WAVELENGTH_NM, index - 1.0))
    assert halo.total == pytest.approx(-math.expm1(-expected), rel=1e-12)
    assert energy == pytest.approx(expected, rel=1e-4)
    assert halo.row == pytest.approx(halo.weights[0] + 2.0 * halo.weights[1:].sum(), rel=1e-12)


def test_a_high_spot_takes_the_halo_off_the_row() -> None:
    stray, sigma = _one_lever(Polish()), 4.0
    halo = halo_weights(200, receiver(stray), sigma_px=sigma)
    y = np.linspace(-60.0, 60.0, 2401)
    height = np.exp(-0.5 * np.square(y / sigma)) / (sigma * math.sqrt(2.0 * math.pi)) * 0.05
    for px in (3, 30, 150):
        each = [_density(math.hypot(px, value), stray.polish, stray.window.index) for value in y]
        predicted = float((height * each).sum())
        assert halo.weights[px] == pytest.approx(predicted, rel=0.03)


def test_the_halo_is_what_the_parts_make_it() -> None:
    bare = [name for name in Stray().enabled if name != "dust"]
    whole = halo_weights(100, receiver(Stray(enabled=bare)))
    assert (np.diff(whole.weights) < 0.0).all()
    steps = [0.5143] * 6 + [0.6172, 0.6172, 0.6150, 0.6150, 0.6172, 0.6172]
    depth = sum(float(tis(2.0, WAVELENGTH_NM, step)) for step in steps)
    assert whole.total == pytest.approx(-math.expm1(-depth), rel=1e-12)
    assert whole.row < whole.total
    assert halo_weights(5, receiver(Stray(enabled=["lens"]))).total == 0.0
    none = receiver(Stray(enabled=bare, polish=CLEAN))
    assert halo_weights(5, none).weights.sum() == 0.0
    near_two = receiver(Stray(enabled=bare, polish=Polish(slope=2.0 + 1e-6)))
    assert halo_weights(50, near_two).weights == pytest.approx(whole.weights[:50], rel=1e-4)
    with pytest.raises(ValueError, match="halo of 0 px"):
        halo_weights(0, none)


@pytest.mark.parametrize(("slope", "length_mm"), [(2.0, 0.2), (1.5, 0.066), (2.5, 0.362)])
def test_the_bsdf_over_the_half_space_is_tis(slope: float, length_mm: float) -> None:
    polish = Polish(slope=slope, length_mm=length_mm)

    def ring(log: float, *, cosine: bool) -> float:
        sine = math.exp(log)
        cos_out = math.sqrt(1.0 - sine**2)
        value = bsdf_k(
            sine, 1.0, cos_out, sigma_nm=2.0, wavelength_nm=WAVELENGTH_NM,
            length_um=1e3 * length_mm, slope=slope,
        )  # fmt: skip
        # f cos d omega over the half space; d omega = 2 pi sine d sine / cos.
        return 2.0 * math.pi * sine**2 * float(value) / (1.0 if cosine else cos_out)

    shape, with_cosine = (
        quad(lambda log, c=c: ring(log, cosine=c), math.log(1e-8), -1e-12, limit=400)[0]
        for c in (False, True)
    )
    whole = float(tis(2.0, WAVELENGTH_NM))
    print(f"s {slope:g}: {shape:.5e}, with its cosine {with_cosine:.5e}, TIS {whole:.5e}")
    assert shape == pytest.approx(whole, rel=1e-4)
    assert 0.7 * whole < with_cosine < whole
    for sine in (1e-3, 1e-2, 0.3):
        inside = quad(lambda log: ring(log, cosine=False), math.log(1e-8), math.log(sine))[0]
        within = float(rough_within(np.array(sine), polish, WAVELENGTH_NM)[()])
        assert inside / whole == pytest.approx(within, rel=1e-4)


def test_what_is_scattered_saturates() -> None:
    for roughness in (2.0, 20.0, 50.0):
        plates = {name: {"index": 2.4} for name in ("window", "filter")}
        stray = Stray.model_validate(
            {"enabled": ["window", "filter", "halo"], "lens": Lens(kind="thin"), **plates}
            | {"polish": Polish(roughness_nm=roughness)}
        )
        single = 4.0 * float(tis(roughness, WAVELENGTH_NM, 1.4))
        assert receiver(stray).total == pytest.approx(1.0 - math.exp(-single), rel=1e-12)
    assert single > 1.0 > receiver(stray).total


@pytest.mark.parametrize("width_um", [2.0, 10.0])
def test_a_scratch_has_the_lobe_of_a_slit(width_um: float) -> None:
    waves = 1e3 * width_um / WAVELENGTH_NM
    whole = quad(lambda s: np.sinc(waves * s) ** 2, 0.0, 1.0, limit=500)[0]
    for sine in (0.01, 0.05, 0.2, 0.7):
        part = quad(lambda s: np.sinc(waves * s) ** 2, 0.0, sine, limit=500)[0]
        found = float(slit_within(np.array(sine), width_um, WAVELENGTH_NM))
        assert found == pytest.approx(part / whole, rel=1e-8)


def test_a_particle_takes_twice_its_area_and_lights_airys_disc() -> None:
    """A pupil with a disc on it, carried to the image by a two-dimensional FFT (Babinet)."""
    count, step_um, across_um = 1024, 4.0, 120.0
    x = (np.arange(count) - count // 2) * step_um
    radius = np.hypot(x[:, None], x)
    pupil = np.clip((1500.0 - radius) / step_um + 0.5, 0.0, 1.0)
    disc = np.clip((0.5 * across_um - radius) / step_um + 0.5, 0.0, 1.0)
    share = disc.sum() / pupil.sum()

    def image(field: Floats) -> Floats:
        return np.abs(np.fft.fftshift(np.fft.fft2(np.fft.ifftshift(field)))) ** 2

    clean, soiled_image = image(pupil), image(pupil - disc)
    whole = clean.sum()
    # The core loses the area twice, the light as a whole only once.
    core = np.unravel_index(clean.argmax(), clean.shape)
    assert soiled_image[core] / clean[core] == pytest.approx((1.0 - share) ** 2, rel=1e-9)
    assert soiled_image.sum() / whole == pytest.approx(1.0 - share, rel=1e-2)
    lobe = image(disc) / whole
    assert lobe.sum() == pytest.approx(share, rel=4e-2)  # its soft rim
    sine = 1e-3 * WAVELENGTH_NM / (count * step_um) * np.hypot(*np.indices(lobe.shape) - count // 2)
    for limit in (1e-3, 3e-3, 6.7e-3, 1e-2, 2e-2):
        inside = lobe[sine < limit].sum() / share
        found = float(disc_within(np.array(limit), across_um, WAVELENGTH_NM))
        print(f"within {limit:g}: {inside:.4f} by FFT, {found:.4f}")
        assert inside == pytest.approx(found, abs=6e-3)


def _mie(diameter_um: float, index: complex, cosine: Floats) -> tuple[float, Floats]:
    """Return Q_ext and |S1|^2 + |S2|^2 of a sphere, Bohren and Huffman 4.53, 4.62, 4.74."""
    x = 1e3 * math.pi * diameter_um / WAVELENGTH_NM
    last = int(x + 4.0 * x ** (1.0 / 3.0) + 2.0)
    n = np.arange(1, last + 1)
    jx, yx = spherical_jn(n, x), spherical_yn(n, x)
    psi, xi = x * jx, x * (jx + 1j * yx)
    djx = spherical_jn(n, x, derivative=True)
    dpsi = jx + x * djx
    dxi = dpsi + 1j * (yx + x * spherical_yn(n, x, derivative=True))
    # Logarithmic derivative of psi(m x), downwards.
    z, steps = index * x, last + 16 + int(abs(index) * x)
    log = np.zeros(steps + 1, complex)
    for k in range(steps, 0, -1):
        log[k - 1] = k / z - 1.0 / (log[k] + k / z)
    d = log[1 : last + 1]
    a = (d / index * psi - dpsi) / (d / index * xi - dxi)
    b = (d * index * psi - dpsi) / (d * index * xi - dxi)
    extinction = 2.0 / x**2 * float(((2 * n + 1) * (a + b).real).sum())
    before, pi = np.zeros_like(cosine), np.ones_like(cosine)
    one = two = np.zeros(len(cosine), complex)
    for k in range(1, last + 1):
        tau = k * cosine * pi - (k + 1) * before
        factor = (2 * k + 1) / (k * (k + 1))
        one = one + factor * (a[k - 1] * pi + b[k - 1] * tau)
        two = two + factor * (a[k - 1] * tau + b[k - 1] * pi)
        before, pi = pi, ((2 * k + 1) * cosine * pi - (k + 1) * before) / k
    return extinction, np.abs(one) ** 2 + np.abs(two) ** 2


def test_mie_has_the_extinction_and_the_lobe_of_dust() -> None:
    index = 1.53 + 0.008j  # mineral dust
    for diameter, bound in ((3.0, 0.25), (10.0, 0.2), (50.0, 0.1), (200.0, 0.04)):
        sine = np.linspace(1e-6, 0.3 * 1e-3 * WAVELENGTH_NM / diameter, 5)
        extinction, light = _mie(diameter, index, np.sqrt(1.0 - sine**2))
        x = 1e3 * math.pi * diameter / WAVELENGTH_NM
        # Of unit irradiance, per solid angle, over the area: light / (2 k^2 area).
        mie = light / 2.0 / (math.pi * x**2)
        airy = x**2 / (4.0 * math.pi) * (2.0 * j1(x * sine) / (x * sine)) ** 2
        print(f"{diameter:g} um: Q_ext {extinction:.3f}, lobe over Airy's {(mie / airy).round(3)}")
        assert extinction == pytest.approx(2.0, abs=bound + 0.15)
        assert mie == pytest.approx(airy, rel=2.0 * bound)


def test_the_lobe_of_dust_is_the_sum_over_its_particles() -> None:
    stray = Stray(
        enabled=["window", "halo", "dust"], lens=Lens(kind="thin"), polish=CLEAN,
        dust=Dust(level=200.0, digs=0, scratches=0),
    )  # fmt: skip
    found = receiver(stray)
    size = np.geomspace(1.0, 200.0, 4001)
    number = -np.diff(particles(200.0, size)) / 0.09290304e12  # per um^2
    middle = np.sqrt(size[1:] * size[:-1])
    angle = np.geomspace(2e-4, 0.3, 400)
    x = 1e3 * math.pi * middle[:, None] / WAVELENGTH_NM * np.sin(angle)
    area = 0.25 * math.pi * np.square(middle)[:, None]
    lobe = area**2 / (1e-3 * WAVELENGTH_NM) ** 2 * (2.0 * j1(x) / x) ** 2
    direct = 4.0 * (number @ lobe)  # four faces, per solid angle
    rings = 4.0 * intensity(emitter(_only_window(stray)), angle) / 2.0  # of two faces
    print("dust over the sum", np.round(rings[10:-10:40] / direct[10:-10:40], 4))
    assert rings[10:-10] == pytest.approx(direct[10:-10], rel=0.03)
    # As much is diffracted as is shadowed, but for what is both.
    assert found.total == pytest.approx(obscured_share(stray), rel=1e-9)
    assert found.total == pytest.approx(4.0 * covered_share(200.0), rel=1e-3)


def _only_window(stray: Stray) -> Stray:
    return stray.model_copy(update={"enabled": ["head_window", "halo", "dust"]})


def test_each_cause_has_its_share_of_the_halo() -> None:
    whole = receiver(Stray())
    shares = whole.shares()
    assert sum(shares.values()) == pytest.approx(whole.total, rel=1e-12)
    covered = soiled(Stray(), 25.0 / 3.0)
    beam = 0.25 * math.pi * (25.0 / 3.0) ** 2
    assert covered["digs"] == pytest.approx(5 * 0.063**2 / beam)
    assert covered["scratches"] == pytest.approx(0.002 * 25.0 / 3.0 / beam)
    for cause in ("digs", "scratches"):
        assert shares[cause] == pytest.approx(10.0 * covered[cause], rel=0.01)
    halo = halo_weights(400, whole)
    clean = halo_weights(
        400, receiver(Stray(enabled=[name for name in Stray().enabled if name != "dust"]))
    )
    ratio = float(halo.weights[20:].max() / clean.weights[20:].max())
    print(f"A at 20 px: {ratio:.1f} times that of roughness alone")
    assert 10.0 < ratio < 25.0


def test_the_scan_head_scatters_by_mirror_and_window() -> None:
    clean = Stray(enabled=["mirror", "head_window", "halo"])
    depth = float(tis(2.5, WAVELENGTH_NM)) + 2.0 * float(tis(2.0, WAVELENGTH_NM, 0.5143))
    assert emitter(clean).total == pytest.approx(-math.expm1(-depth), rel=1e-12)
    assert emitter(Stray(enabled=["halo", "dust"])).total == 0.0
    dusty = Stray(enabled=["mirror", "dust"], mirror=Mirror(roughness_nm=0.0))
    assert emitter(dusty).total == pytest.approx(sum(soiled(dusty, 25.0 / 3.0).values()), rel=1e-9)
    angle = np.geomspace(1e-5, 1.5, 3000)
    found = intensity(emitter(clean), angle)
    sent = 2.0 * math.pi * np.trapezoid(found * np.sin(angle) * angle, np.log(angle))
    assert sent == pytest.approx(emitter(clean).total, rel=2e-3)


def _scene(**tables: object) -> Description:
    plane = {"kind": "plane", "position_mm": [0, 0, 420.0]}
    return Description.model_validate({"target": [plane], **tables})


def _skirt(light: Light, angle: float) -> Singles:
    line = np.zeros((1, light.config.sensor.line_length), np.float32)
    light.add_skirt(line, 1.0, np.array([angle]), np.zeros(1))
    return line[0]


def test_light_beside_the_beam_is_what_the_bsdf_sends_there() -> None:
    light = Light(_scene(), Config())
    angle = 0.02
    row = _skirt(light, angle).astype(np.float64)
    phi, base = light.config.geometry.bias_rad, light.config.geometry
    lens = np.array([base.base_mm, 0.0, base.offset_mm])
    checked = 0
    for pixel in (200, 700, 900, 1100, 1300, 1900):
        beta = phi + math.atan((pixel - base.centre_px) * base.pitch_mm / base.focal_mm)
        ray = np.array([-math.cos(beta), 0.0, math.sin(beta)])
        point = lens + (420.0 - lens[2]) / ray[2] * ray
        away = float(np.linalg.norm(point))
        off = abs(math.atan2(point[0], point[2]) - angle)
        if off < 3e-3:
            continue
        near = np.array([0.99, 1.0, 1.01]) * off
        per_sr = float(intensity(light.emitter, near)[1])
        lit = per_sr * (point[2] / away) / away**2  # mm^-2 of the beam's light
        eye = math.pi / 36.0 * math.cos(beta - phi) ** 4 * base.pitch_mm**2
        want = lit * 0.3 / math.pi * eye / (1.0 - light.emitter.total)
        print(f"{pixel}: {off:.4f} rad, {row[pixel]:.3e} / {want:.3e}")
        assert row[pixel] == pytest.approx(want, rel=0.05)
        checked += 1
    assert checked >= 5


def test_the_line_has_the_light_of_the_patches_beside_the_spot() -> None:
    """Every patch that a pixel sees has its solid angle's share, and shines as the spot does."""
    stray = {"enabled": ["mirror", "halo"]}
    light = Light(_scene(stray=stray, laser={"aperture_mm": math.inf}), Config())
    zero = np.zeros(1)
    when = Timeline(np.zeros(1, np.int64), *[zero] * 5, zero[:0], np.zeros(0, np.bool_))
    plain, got = (Renderer(light, frozenset(names)).charge(when) for names in ((), ("skirt",)))
    extra = (got.laser_e - plain.laser_e)[0].astype(np.float64)
    spot = int(plain.laser_e[0].argmax())
    point, normal, _, _ = light.look(np.arange(2048.0), 0.0)
    camera = light.config.geometry
    eye = np.array([camera.base_mm, 0.0, camera.offset_mm])
    for pixel in (spot - 150, spot - 80, spot + 80, spot + 150):
        sight = point[pixel] - eye
        far = float(np.linalg.norm(sight))
        pixel_sr = (camera.pitch_mm / camera.focal_mm) ** 2
        u = (pixel - camera.centre_px) * camera.pitch_mm
        pixel_sr *= math.cos(math.atan(u / camera.focal_mm)) ** 3
        patch = pixel_sr * far**2 / -float(sight @ normal[pixel] / far)
        away = float(np.linalg.norm(point[pixel]))
        solid = patch * -float(point[pixel] @ normal[pixel]) / away**3
        off = abs(math.atan2(point[pixel, 0], point[pixel, 2]))
        per_sr = float(intensity(light.emitter, np.array([0.99, 1.0, 1.01]) * off)[1])
        left = 1.0 - light.emitter.total
        want = float(plain.whole_e[0]) / left * per_sr * solid
        print(f"{pixel - spot:+d} px: {extra[pixel]:.4f} e of {want:.4f}")
        assert extra[pixel] == pytest.approx(want, rel=0.12)  # the lens is elsewhere for the spot


def test_a_block_hides_what_is_behind_it_from_the_skirt() -> None:
    block = {"kind": "box", "position_mm": [0, 0, 350.0], "size_mm": [20, 20, 20]}
    plane = {"kind": "plane", "position_mm": [0, 0, 420.0]}
    scene = Description.model_validate({"target": [plane, block]})
    light = Light(scene, Config())
    row = _skirt(light, 0.1)
    point, _, target, _ = light.look(np.arange(2048.0), 0.0)
    behind = (target == 0) & (np.abs(point[:, 0] / point[:, 2]) < 10.0 / 340.0 - 1e-3)
    clear = (target == 0) & (np.abs(point[:, 0] / point[:, 2]) > 10.0 / 340.0 + 1e-3)
    assert behind.sum() > 5 and clear.sum() > 100
    assert (row[behind] == 0.0).all()
    assert (row[clear] > 0.0).all()


def test_the_veil_is_the_light_at_the_window_over_the_attenuation() -> None:
    lamp = {"kind": "halogen", "illuminance_lux": 2000.0}
    light = Light(_scene(lamp=[lamp]), Config())
    half = Light(_scene(lamp=[lamp], stray={"out_of_field": 2e4}), Config())
    assert light.veil_e() == pytest.approx(2.0 * half.veil_e(), rel=1e-9)
    # A white wall around the lens would send the irradiance itself: over C of the lens it is 1/36.
    white = Light(
        _scene(lamp=[lamp], material={"default": {"reflectance": 1.0}}), Config()
    ).ambient("lamps", 0.0)[1023]
    through = light.scene.lens.transmission * light.scene.lens.filter_transmission
    ratio = light.veil_e() / white
    print(f"veil {light.veil_e():.3f} e, {ratio:.2e} of a white wall's image")
    assert ratio == pytest.approx(1e-4 * 36.0 / through, rel=0.3)
    assert Light(_scene(), Config()).veil_e() == 0.0


def test_a_receiver_in_fog_is_refused() -> None:
    plate = {"index": 2.4}
    rough = {"polish": {"roughness_nm": 50.0}, "window": plate, "filter": plate}
    with pytest.raises(InputError, match=r"^scene: stray: the receiver scatters 0\.\d+ .*rough"):
        Light(_scene(stray=rough), Config())
    with pytest.raises(InputError, match=r"the receiver scatters .*most of it by dust"):
        Light(_scene(stray={"dust": {"level": 1900.0}}), Config())
    with pytest.raises(InputError, match=r"the scan head scatters .*roughness"):
        Light(_scene(stray={"mirror": {"roughness_nm": 50.0}}), Config())
