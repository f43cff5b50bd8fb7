import copy
from pathlib import Path

import pytest
import yaml

import vinsar
from vinsar.foundations.errors import ConfigurationError
from vinsar.study import validation, work

CONFIG = Path(__file__).parents[2] / "config"
PAPER = yaml.safe_load((CONFIG / "paper.yaml").read_text())
BOX = {"shape": "box", "x_m": 0.0, "y_m": 12.0, "size_x_m": 0.5, "size_y_m": 0.5, "height_m": 0.3}
PIT = {"shape": "pit", "x_m": 0.0, "y_m": 12.0, "diameter_m": 0.5, "depth_m": 0.3}
MOUND = {"shape": "mound", "x_m": 0.0, "y_m": 12.0, "diameter_m": 0.5, "height_m": 0.2}
PATCH = {"x_m": 0.0, "y_m": 12.0, "size_x_m": 0.5, "size_y_m": 0.5, "reflectivity": 1.0}
RECTANGLE = {"x_min_m": -1.0, "x_max_m": 1.0, "y_min_m": 10.5, "y_max_m": 11.0}


BETWEEN = {"x_min_m": 0.001, "x_max_m": 0.019, "y_min_m": 12.001, "y_max_m": 12.019}
POINT = {"x_m": 0.0, "y_m": 12.0, "height_m": 0.0}
CONTROLLED = PAPER["height"] | {"reference": "control_points"}
BLACK = {"x_m": 0.0, "y_m": 13.0, "size_x_m": 5.0, "size_y_m": 6.0, "reflectivity": 0.0}


@pytest.fixture(autouse=True)
def _a_machine_of_16_gb(monkeypatch):
    monkeypatch.setattr(work, "memory", lambda: 16e9)


def changed(**values):
    """Return the paper's configuration with ``section__key`` set."""
    raw = copy.deepcopy(PAPER)
    for path, value in values.items():
        section, _, key = path.partition("__")
        if key:
            raw[section][key] = value
        else:
            raw[section] = value
    return raw


def faults(raw) -> dict[str, str]:
    with pytest.raises(ConfigurationError) as caught:
        validation.check(raw)
    assert all(str(fault) in str(caught.value) for fault in caught.value.faults)
    return {fault.key: fault.allowed for fault in caught.value.faults}


MOVING = {
    "forward_speed_m_per_s": 10.0, "scan_duration_s": 0.1, "speed_correction": "exact",
    "speed_error_m_per_s": 0.0, "scan_interval_s": None,
}  # fmt: skip


@pytest.mark.parametrize("path", sorted(CONFIG.glob("*.yaml")), ids=lambda path: path.stem)
def test_every_shipped_study_is_valid(path):
    assert validation.check(validation.read(CONFIG / "paper.yaml", path)).study == path.stem


@pytest.mark.parametrize(
    ("change", "says"),
    [
        ({"scene__facet_jitter": 0.0}, "scatter like a crystal"),
        ({"echo__snr_db": -40.0}, "coherence of 0.0001"),
        ({"radar__baseline_m": 1.0e-6}, "shorter than the wavelength"),
        ({"radar__position_spacing_m": 0.4, "radar__system": "receive_pair",
          "outputs__claims": False}, "an aperture of 3 positions"),
        ({"height__level_ground_height_m": 1.5}, "is off the terrain, -0.3 to 0.3 m"),
        ({"height": CONTROLLED | {"control_points": [POINT | {"height_m": -2.0}]}}, "off the"),
    ],
)  # fmt: skip
def test_nonsense_that_is_allowed_has_a_word_of_its_own(change, says):
    said = validation.advice(validation.check(changed(**change)))
    assert any(says in sentence for sentence in said), said


def test_the_paper_is_wise():
    assert validation.advice(validation.check(PAPER)) == []


ODD_NAMES = [
    "", "<x>", "x}", "{x}", "a/b", "..", ".x", " x", "x ", "-n", "a\\b", "$HOME", "a'b", 'a"b',
    "a*", "a\nb", "a\x1b[2Jb", "x" * 81, "x" * 300, "Höhe", "<!--<script ", "a;b",
]  # fmt: skip
SWEEP = {"over": {"echo.snr_db": [1.0]}, "realizations": 1, "base": {}}


@pytest.mark.parametrize(
    ("change", "key", "says"),
    [
        ({"radar__baseline": 0.3}, "radar.baseline", "did you mean radar.baseline_m"),
        ({"radr": {}}, "radr", "did you mean radar"),
        ({"figures__font_size_pt": 8.1}, "figures.font_size_pt", "at most 8.00 for figures 88 and"),
        ({"figures__two_columns_mm": 160.0}, "figures.font_size_pt", "at most 7.11"),
        ({"figures__formats": ["pdf"]}, "figures.formats", "must hold png"),
        ({"figures__formats": ["png", "png"]}, "figures.formats", "each format once"),
        ({"figures__formats": ["jpg"]}, "figures.formats[0]", "'pdf', 'svg' or 'png'"),
        (
            {"radar__baselines_m": [0.3, 0.06]},
            "radar.baselines_m",
            "must rise from above 0, no two of them equal",
        ),
        ({"radar__baselines_m": [0.3, 0.3]}, "radar.baselines_m", "no two of them equal"),
        ({"radar__baselines_m": [-0.1, 0.3]}, "radar.baselines_m", "must rise from above 0"),
        ({"radar__baselines_m": []}, "radar.baselines_m", "at least 1"),
        (
            {"radar__baselines_m": [0.06, 0.3], "autofocus__method": "echoes"},
            "autofocus.method",
            "takes 2 antennas at most, but radar.baselines_m makes 3",
        ),
        ({"radar__baselines_m": [0.06, 0.2]}, "radar.baselines_m", "end with radar.baseline_m"),
        ({"unwrapping__method": "baselines"}, "unwrapping.method", "two baselines or more"),
        (
            {"radar__baselines_m": [0.3 * n / 1e5 for n in range(1, 100_001)]},
            "radar.baselines_m",
            "take fewer antennas",
        ),
        ({"seed": -1}, "seed", "greater than or equal to 0"),
        *(
            ({section: {name: content} if content is not None else name}, key, "1 to 80 letters")
            for name in ODD_NAMES
            for section, content, key in (
                ("study", None, "study"),
                ("variants", {"seed": 1}, f"variants.{name}"),
                ("sweeps", SWEEP, f"sweeps.{name}"),
            )
        ),
        ({"scene__terrain": "peak"}, "scene.terrain", "'peaks', 'flat' or 'file'"),
        ({"radar__stop_frequency_hz": "15e9"}, "radar.stop_frequency_hz", "write 15000000000"),
        ({"radar__stop_frequency_hz": 12e9}, "radar.stop_frequency_hz", "must exceed"),
        ({"radar__baseline_m": -0.3}, "radar.baseline_m", "greater than 0"),
        ({"radar__position_spacing_m": 0.03}, "radar.position_spacing_m", "must divide"),
        ({"scene__terrain": "file"}, "scene.file", "must name the file"),
        ({"scene__file": "dem.tif"}, "scene.file", "is not read for scene.terrain 'peaks'"),
        ({"measurement__file": "echo.nc"}, "outputs.claims", "must be false"),
        (
            {"measurement__file": "echo.nc", "vehicle__forward_speed_m_per_s": 1.0},
            "vehicle.forward_speed_m_per_s",
            "must be 0",
        ),
        ({"scene__x_max_m": -3.0}, "scene.x_max_m", "must exceed x_min_m"),
        ({"scene__terrain_spacing_m": 0.011}, "scene.terrain_spacing_m", "must divide"),
        ({"scene__reflectivity_offset": 0.1}, "scene.reflectivity_offset", "at least 0.24"),
        ({"imaging__grid_spacing_m": 0.021}, "imaging.grid_spacing_m", "must divide"),
        ({"scene__y_min_m": -5.0}, "scene.y_min_m", "look ahead"),
        ({"scene__objects": [BOX | {"shape": "bx"}]}, "scene.objects[0]", "'box', 'stump'"),
        ({"scene__objects": [BOX | {"hight_m": 1.0}]}, "scene.objects[0].hight_m", "height_m"),
        (
            {"scene__objects": [PIT, BOX | {"height_m": -0.1}]},
            "scene.objects[1].height_m",
            "greater than 0",
        ),
        (
            {"scene__objects": [BOX | {"reflectivity": -0.1}]},
            "scene.objects[0].reflectivity",
            "greater than or equal to 0",
        ),
        # A quarter of its diagonal wider when it is turned by 45 degrees.
        (
            {"scene__objects": [BOX | {"x_m": 2.2, "rotation_deg": 45.0}]},
            "scene.objects[0].x_m",
            "from 1.85 to 2.55 m, but must lie in the scene, x -2.5 to 2.5 m",
        ),
        (
            {"scene__objects": [PIT | {"y_m": 15.9}]},
            "scene.objects[0].y_m",
            "from 15.7 to 16.1 m, but must lie in the scene, y 10 to 16 m",
        ),
        ({"scene__objects": [PIT | {"depth_m": 2.0}]}, "scene.objects[0].depth_m", "below radar"),
        ({"scene__objects": [BOX | {"height_m": 2.0}]}, "scene.objects[0].height_m", "below radar"),
        ({"scene__objects": [BOX | {"height_m": 1.8}]}, "scene.objects[0].height_m", "the 0.3 m"),
        (
            {"scene__objects": [BOX | {"height_m": 0.9}, BOX | {"x_m": 0.4, "height_m": 0.9}]},
            "scene.objects[1].height_m",
            "with the 1.2 m beneath it be below",
        ),
        (
            {"scene__peak_height_m": 2.5, "scene__reflectivity_offset": 3.0},
            "scene.peak_height_m",
            "must be below radar.rail_height",
        ),
        ({"radar__stop_frequency_hz": 13.0e9 + 1}, "radar.stop_frequency_hz", "resolves 1.5e+08 m"),
        ({"interferogram__coherence_window_px": 9999}, "interferogram.coherence_window_px", "251"),
        (
            {"filtering__method": "boxcar", "filtering__boxcar_window_px": 9999},
            "filtering.boxcar_window_px",
            "at most 251",
        ),
        ({"filtering__goldstein_patch_px": 512}, "filtering.goldstein_patch_px", "at most 301"),
        ({"height__level_ground": [BETWEEN]}, "height.level_ground[0]", "holds 0 x 0 pixels"),
        ({"height__level_ground_height_m": 100.0}, "height.level_ground_height_m", "to 2 m"),
        ({"height__level_ground_height_m": -100.0}, "height.level_ground_height_m", "-8.3 to"),
        (
            {"height": CONTROLLED | {"control_points": [POINT | {"height_m": 50.0}]}},
            "height.control_points[0].height_m",
            "below the antennas",
        ),
        *(
            (
                {"height": CONTROLLED | {"trend": "plane", "control_points": points}},
                "height.control_points",
                "in one line",
            )
            for points in (
                [POINT] * 3,
                [POINT | {"x_m": x, "y_m": 12.0 + x} for x in (-1.0, 0.0, 0.5, 1.0)],
            )
        ),
        ({"registration__height_max_m": 1.0e6}, "registration.height_max_m", "below radar.rail"),
        ({"registration__map_height_m": 2.0}, "registration.map_height_m", "below radar.rail"),
        (
            {"vehicle__speed_correction": "sensor", "vehicle__speed_error_m_per_s": 60.0},
            "vehicle.speed_error_m_per_s",
            "at most 9.97 m/s",
        ),
        *(
            (
                {"vehicle": MOVING | {"speed_correction": "next_scan"} | vehicle},
                f"vehicle.{key}",
                text,
            )
            for vehicle, key, text in (
                (
                    {"scan_interval_s": 0.05},
                    "scan_interval_s",
                    "at least the time of a scan, 0.1 s",
                ),
                ({"scan_interval_s": 2.0}, "forward_speed_m_per_s", "to the end of the next one"),
                ({"speed_error_m_per_s": 60.0}, "speed_error_m_per_s", "drives into the scene"),
            )
        ),
        ({"scene__patches": [BLACK]}, "scene.patches[0].reflectivity", "no echo"),
        ({"radar__position_spacing_m": 0.8}, "radar.position_spacing_m", "makes 2 positions"),
        ({"imaging__grid_spacing_m": 0.0001}, "imaging.grid_spacing_m", "GB in 'images'"),
        ({"scene__terrain_spacing_m": 1.0e-6}, "scene.terrain_spacing_m", "GB in 'terrain'"),
        ({"scene__facet_size_m": 1.0e-5}, "scene.facet_size_m", "GB in 'facets'"),
        ({"scene__facet_size_m": 9.0e-4}, "scene.facet_size_m", "GB in 'visibility'"),
        ({"radar__frequency_count": 10_000_001}, "radar.frequency_count", "GB in 'profiles'"),
        ({"radar__position_spacing_m": 8.0e-10}, "radar.position_spacing_m", "GB in 'trajectory'"),
        ({"filtering__goldstein_patch_px": 10**6}, "filtering.goldstein_patch_px", "in 'filtered'"),
        ({"registration__height_count": 10**9}, "registration.height_count", "in 'registration'"),
        (
            {"sweeps": {"noise": SWEEP | {"realizations": 30_000_000}}},
            "sweeps.noise.realizations",
            "makes 3e+07 cases of the sweep 'noise', about 240 GB",
        ),
        ({"radar__baseline_m": 1.0e300}, "radar.baseline_m", "from 1e-30 to 1e+30"),
        ({"radar__position_spacing_m": 1.0e-300}, "radar.position_spacing_m", "from 1e-30"),
        ({"scene__objects": [MOUND | {"height_m": 0.3}]}, "scene.objects[0].height_m", "0.25 m"),
        ({"scene__objects": [PIT | {"diameter_m": 0.01}]}, "scene.objects[0].diameter_m", "0.02 m"),
        ({"scene__patches": [PATCH | {"size_x_m": 6.0}]}, "scene.patches[0].x_m", "in the scene"),
        (
            {"scene__patches": [PATCH | {"reflectivity": -1.0}]},
            "scene.patches[0].reflectivity",
            "greater than or equal to 0",
        ),
        (
            {"scene__roughness_std_m": 0.01, "scene__roughness_correlation_m": 0.01},
            "scene.roughness_correlation_m",
            "at least twice scene.terrain_spacing_m, 0.02 m",
        ),
        ({"radar__frequency_count": 101}, "scene.y_max_m", "unambiguous range, 7.49 m"),
        ({"scene__facet_size_m": 0.05}, "scene.facet_size_m", "half a resolution cell"),
        ({"radar__position_spacing_m": 0.04}, "radar.position_spacing_m", "ambiguously"),
        ({"imaging__grid_spacing_y_m": 0.7}, "imaging.grid_spacing_y_m", "must divide the extent"),
        ({"interferogram__coherence_window_px": 4}, "interferogram.coherence_window_px", "odd"),
        ({"filtering__goldstein_step_px": 24}, "filtering.goldstein_step_px", "1, 2, 4, 8, 16, 32"),
        ({"registration__height_max_m": -1.0}, "registration.height_max_m", "must exceed"),
        (
            {"registration__near": {"x_m": 0.0, "y_m": 0.5}, "registration__height_max_m": 1.0},
            "registration.near.y_m",
            "no image on the ground",
        ),
        ({"height__level_ground": []}, "height.level_ground", "one rectangle or more"),
        (
            {"height__level_ground": [RECTANGLE | {"y_max_m": 17.0}]},
            "height.level_ground[0]",
            "must lie in the image",
        ),
        (
            {"height__level_ground": [RECTANGLE | {"y_mx_m": 17.0}]},
            "height.level_ground[0].y_mx_m",
            "did you mean height.level_ground.y_max_m",
        ),
        (
            {"height__reference": "control_points", "height__trend": "plane"},
            "height.control_points",
            "must hold 3 or more",
        ),
        ({"figures__height_colormap": "cmc.batlov"}, "figures.height_colormap", "cmc.batlow"),
        ({"figures__phase_colormap": "twilght"}, "figures.phase_colormap", "twilight"),
    ],
)
def test_a_fault_names_its_key_and_what_is_allowed(change, key, says):
    found = faults(changed(**change))
    assert says in found[key]


def test_all_faults_come_in_one_message():
    raw = changed(
        radar__baselin_m=0.3, scene__facet_size_m="small", filtering__goldstein_step_px=24,
        imaging__x_max_m=-9.0,
    )  # fmt: skip
    assert set(faults(raw)) == {
        "radar.baselin_m",
        "scene.facet_size_m",
        "filtering.goldstein_step_px",
        "imaging.x_max_m",
    }


def test_the_advised_frequency_count_suffices():
    advice = faults(changed(radar__frequency_count=101))["scene.y_max_m"]
    count = int(advice.split("frequency_count ")[1].split()[0])
    validation.check(changed(radar__frequency_count=count))
    faults(changed(radar__frequency_count=count - 1))


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (
            {"radar__baselines_m": [0.004, 0.3]},
            "shorter than a quarter of the wavelength, 0.0054 m",
        ),
        ({"radar__baseline_m": 2.5}, "quarter of the critical baseline, 1.050 m"),
        ({"scene__facet_size_m": 0.02}, "below the wavelength, 0.0214 m"),
        ({"imaging__y_max_m": 17.0}, "beyond the scene"),
        # At x = 0: lambda r / 2L at y = 10 m, c r / 2W y at y = 16 m; a sinc falls by 3 dB within
        # 0.886 of that.
        ({"imaging__grid_spacing_x_m": 0.125}, "-3 dB width in x where it is least, 0.1209 m"),
        ({"imaging__grid_spacing_y_m": 0.08}, "-3 dB width in y where it is least, 0.0669 m"),
    ],
)
def test_what_is_unwise_is_said_and_allowed(change, says):
    (sentence,) = validation.advice(validation.check(changed(**change)))
    assert says in sentence


ARRAY = {"radar__system": "transmit_pair", "outputs__claims": False}


def test_an_array_may_have_elements_as_wide_apart_as_it_images_without_ambiguity():
    # Twice the 2.1 cm of a rail: sines of 2.5 / sqrt(2.5^2 + 10^2 + 2^2) on either side, 2 cm.
    assert (
        validation.advice(validation.check(changed(radar__position_spacing_m=0.02, **ARRAY))) == []
    )
    (sentence,) = validation.advice(
        validation.check(changed(radar__position_spacing_m=0.05, **ARRAY))
    )
    assert "wider than 0.0420 m: grating lobes" in sentence


def test_a_baseline_between_transmitters_may_be_twice_as_long():
    quarter = {"radar__baseline_m": 1.5}
    assert len(validation.advice(validation.check(changed(**quarter)))) == 1
    assert validation.advice(validation.check(changed(**quarter, **ARRAY))) == []


def test_claims_are_those_of_a_rail():
    found = faults(changed(radar__system="receive_pair"))
    assert "those of a rail" in found["outputs.claims"]


def test_a_transmitter_in_the_scene_is_refused():
    found = faults(changed(radar__transmitter_y_m=10.0, **ARRAY))
    assert "look ahead" in found["scene.y_min_m"]


def test_a_vehicle_that_reaches_the_scene_before_the_scan_ends_is_refused():
    raw = changed(vehicle=MOVING | {"scan_duration_s": 2.5}, radar__position_spacing_m=0.001)
    says = faults(raw)["vehicle.forward_speed_m_per_s"]
    # 10 m to the scene less a facet, in half of 2.5 s.
    assert "at most 7.98 m/s" in says
    assert "at most 1.99 s (vehicle.scan_duration_s)" in says
    assert "drives 12.5 m" in says
    raw["vehicle"]["scan_duration_s"] = 1.99
    validation.check(raw)


def test_positions_that_the_vehicle_draws_apart_are_refused():
    # 0.2 m a step: from the middle of the way y / r goes over the scene from 0.95 to 0.99 and x / r
    # to -0.24 at the near edge: out and back 16 mm, and 5 mm by the cart's own step. A turn is
    # 20 mm.
    vehicle = MOVING | {"forward_speed_m_per_s": 8.0, "scan_duration_s": 2.0}
    says = faults(changed(vehicle=vehicle))["vehicle.forward_speed_m_per_s"]
    assert "drives 0.2 m from one antenna position" in says
    validation.check(changed(vehicle=vehicle | {"scan_duration_s": 1.2}))


def test_the_way_of_the_vehicle_counts_for_the_unambiguous_range():
    # 16.5 m at rest, of 18.7 m; from the first position, 5 m behind, hypot(21, 2.9, 2.3).
    assert validation.check(changed(radar__frequency_count=251, vehicle=MOVING))
    vehicle = MOVING | {"scan_duration_s": 1.0}
    assert "21.32" in faults(changed(radar__frequency_count=251, vehicle=vehicle))["scene.y_max_m"]


def test_an_aperture_that_points_into_the_image_is_advised_against():
    vehicle = MOVING | {"scan_duration_s": 0.5}
    (sentence,) = validation.advice(validation.check(changed(vehicle=vehicle)))
    # y / x = 10 / 2.5 in the near right corner, at a cart speed of 1.6 m/s.
    assert "apart up to 6.4 m/s" in sentence
    # With a transmitter that stands, an array of the same length turns twice as fast.
    dwell = 0.5 / (2 * 81 * 401)
    array = changed(
        vehicle=vehicle | {"scan_duration_s": 9.0}, radar__system="receive_pair",
        radar__dwell_s=dwell, outputs__claims=False,
    )  # fmt: skip
    array["outputs"]["figures"] = []
    assert any("apart up to 3.2 m/s" in said for said in validation.advice(validation.check(array)))
    vehicle |= {"forward_speed_m_per_s": 6.3}
    assert validation.advice(validation.check(changed(vehicle=vehicle))) == []


def test_files_override_in_order(tmp_path):
    first, second = tmp_path / "first.yaml", tmp_path / "second.yaml"
    first.write_text("seed: 1\nradar: {baseline_m: 0.4, rail_height_m: 2.5}\n")
    second.write_text("study: second\nradar: {baseline_m: 0.5}\n")
    study = vinsar.load(first, second)
    assert (study.seed, study.radar.baseline_m, study.radar.rail_height_m) == (1, 0.5, 2.5)
    assert study.radar.aperture_length_m == 0.8


@pytest.mark.parametrize("content", ["radar: [", "- 1\n"])
def test_a_file_that_is_no_configuration_is_named(tmp_path, content):
    path = tmp_path / "broken.yaml"
    path.write_text(content)
    with pytest.raises(ValueError, match=r"broken\.yaml"):
        vinsar.load(path)


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(ValueError, match=r"absent\.yaml"):
        vinsar.load(tmp_path / "absent.yaml")


def test_variants_are_checked_as_studies_all_at_once():
    raw = changed(variants={"good": {"seed": 1}, "bad": {"seed": -1}, "worse": {"rader": {}}})
    study = validation.check(raw)
    with pytest.raises(ConfigurationError) as caught:
        validation.variants(study)
    assert [fault.key for fault in caught.value.faults] == [
        "variants.bad: seed",
        "variants.worse: rader",
    ]


def test_a_variant_is_the_study_but_for_its_changes():
    study = validation.check(changed(variants={"low": {"radar": {"rail_height_m": 1.8}}}))
    low = validation.variants(study)["low"]
    assert low.radar == study.radar.model_copy(update={"rail_height_m": 1.8})
    assert low.scene == study.scene
    assert low.variants == {}


def test_a_gate_into_the_scene_is_refused():
    for method in ("gate", "both"):
        found = faults(changed(suppression={"method": method, "gate_range_m": 6.0}))
        assert found == {
            "suppression.gate_range_m": "must be at most 5.10 m: half the slant range of the "
            "image's near edge, and what the unambiguous range leaves beyond its far edge"
        }
    validation.check(changed(suppression={"method": "common", "gate_range_m": 6.0}))
    # 241 frequencies repeat after 17.99 m; the far edge is at up to 16.42 m.
    raw = changed(radar__frequency_count=241, suppression={"method": "gate", "gate_range_m": 1.6})
    assert "at most 1.57 m" in faults(raw)["suppression.gate_range_m"]


def test_a_coupling_from_beyond_the_gate_is_unwise():
    raw = changed(
        echo__coupling_db=60.0,
        echo__coupling_path_m=2.4,
        suppression={"method": "gate", "gate_range_m": 1.0},
    )
    assert ["the coupling comes from beyond it, 1.2 m" in found for found in
            validation.advice(validation.check(raw))] == [True]  # fmt: skip


def test_measured_echoes_have_no_scene_to_be_wrong():
    raw = changed(scene__facet_size_m=2.0, outputs__claims=False, measurement__file="echo.nc")
    assert validation.check(raw).scene.facet_size_m == 2.0
    assert "scene.facet_size_m" in faults(raw | {"measurement": {"file": None}})


def test_a_sweep_of_the_baseline_keeps_the_antennas_that_stay_below_the_upper_one():
    sweep = {"realizations": 1, "base": {}, "over": {"radar.baseline_m": [0.05, 0.1, 0.5]}}
    raw = changed(radar__baselines_m=[0.06, 0.2, 0.3], sweeps={"length": sweep})
    found = [case.radar for _, case in validation.sweep_studies(validation.check(raw), "length")]
    assert [radar.baselines for radar in found] == [(0.05,), (0.06, 0.1), (0.06, 0.2, 0.5)]
    assert [radar.baseline_m for radar in found] == [0.05, 0.1, 0.5]


def test_sweeps_and_variants_keep_to_the_one_file_of_a_terrain():
    sweep = {"realizations": 1, "base": {}, "over": {"scene.x_max_m": [2.5, 2.0]}}
    raw = changed(
        scene__terrain="file",
        scene__file="dem.tif",
        sweeps={"wide": sweep},
        variants={
            "turned": {"scene": {"heading_deg": 90.0}},
            "level": {"scene": {"terrain": "flat", "file": None}},
            "lower": {"radar": {"rail_height_m": 1.8}},
            "measured": {"measurement": {"file": "echo.nc"}, "outputs": {"claims": False}},
        },
    )
    study = validation.check(raw)
    with pytest.raises(ConfigurationError) as caught:
        validation.sweep_studies(study, "wide")
    (fault,) = caught.value.faults
    assert "{'scene.x_max_m': 2.0}: scene.x_max_m" in fault.key
    with pytest.raises(ConfigurationError) as caught:
        validation.variants(study)
    assert [fault.key for fault in caught.value.faults] == [
        "variants.turned: scene.heading_deg",
        "variants.measured: measurement.file",
    ]
