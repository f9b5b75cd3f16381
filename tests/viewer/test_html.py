"""The page on disk, without a browser."""

import base64
import json
import re
import stat
from pathlib import Path

import meshcat
import numpy as np
import pinocchio as pin
import pytest
import umsgpack

import rps_pin.viewer.files.html as html_module
from rps_pin.errors import InputError
from rps_pin.viewer import write_html
from rps_pin.viewer.files.page import inline_script, licences
from tests.viewer.robots import motion_page

FLOAT32_ARRAY = 0x17


def page_of(sample, **options) -> str:
    return motion_page(sample.model, sample.visual, sample.times, sample.configurations, **options)


def commands(text: str) -> list[dict]:
    """Return the commands that a page carries."""
    found = re.search(r'id="commands">\n(.*?)\n</script>', text, re.DOTALL)
    assert found is not None
    return [umsgpack.unpackb(base64.b64decode(item)) for item in json.loads(found[1])]


def floats(packed) -> np.ndarray:
    assert packed.type == FLOAT32_ARRAY
    return np.frombuffer(packed.data, dtype="<f4")


def clips(text: str) -> dict[str, dict[str, np.ndarray]]:
    """Return times and values of each path's tracks."""
    animation = commands(text)[-1]
    assert animation["type"] == "set_animation"
    return {
        clip["path"]: {
            **{track["name"]: floats(track["values"]) for track in clip["clip"]["tracks"]},
            "times": floats(clip["clip"]["tracks"][0]["times"]),
        }
        for clip in animation["animations"]
    }


def test_keyframes_are_pinocchios_link_poses(sample):
    found = clips(page_of(sample))
    assert sorted(found) == [f"/world/robot/{name}" for name in ("cylinder.1", "platform", "rod")]
    data = sample.model.createData()
    for path, frame in {"rod": "rod", "cylinder.1": "cylinder/1", "platform": "platform"}.items():
        clip = found[f"/world/robot/{path}"]
        positions = clip[".position"].reshape(-1, 3)
        quaternions = clip[".quaternion"].reshape(-1, 4)
        assert len(clip["times"]) == len(positions) == len(quaternions) == 61
        for index in (0, 17, 60):
            time = float(clip["times"][index])
            row = sample.configurations[round(time * 1000)]
            pin.framesForwardKinematics(sample.model, data, row)
            pose = data.oMf[sample.model.getFrameId(frame)]
            np.testing.assert_allclose(positions[index], pose.translation, atol=2e-3)
            turned = pin.Quaternion(quaternions[index].astype(float)).normalized().matrix()
            np.testing.assert_allclose(turned, pose.rotation, atol=4e-3)


def test_quaternion_keyframes_never_change_sign_at_once(sample):
    clip = clips(page_of(sample))["/world/robot/platform"]
    quaternions = clip[".quaternion"].reshape(-1, 4)
    steps = np.einsum("ij,ij->i", quaternions[1:], quaternions[:-1])
    assert steps.min() > 0.99
    # One full turn ends on the other sign: the test is worth something.
    assert quaternions[0] @ quaternions[-1] < -0.99


def test_the_animation_loops_for_ever_in_seconds(sample):
    animation = commands(page_of(sample))[-1]
    assert animation["options"] == {"play": True, "repetitions": float("inf")}
    assert {clip["clip"]["fps"] for clip in animation["animations"]} == {1}
    assert clips(page_of(sample))["/world/robot/rod"]["times"][-1] == pytest.approx(2.0)


def test_the_frame_rate_sets_the_number_of_keyframes(sample):
    assert len(clips(page_of(sample, frame_rate=10.0))["/world/robot/rod"]["times"]) == 21


def test_the_file_is_the_library_and_little_else(sample, tmp_path):
    path = tmp_path / "viewer.html"
    write_html(path, sample.model, sample.visual, sample.times, sample.configurations)
    library = Path(meshcat.viewer_assets_path(), "dist", "main.min.js").read_text(encoding="utf-8")
    text = path.read_text(encoding="utf-8")
    assert library in text
    assert len(text) < len(library) + 80_000


def test_nothing_on_the_page_points_elsewhere(sample):
    text = page_of(sample)
    outside = re.sub(r"<script.*?</script>", "", text, flags=re.DOTALL)
    assert re.findall(r"""(?:src|href|url)\s*[=(]\s*["']?([^"' >)]*)""", outside) == ["data:,"]
    assert "default-src &#x27;none&#x27;" in text


def test_the_same_motion_gives_the_same_page(sample):
    assert page_of(sample) == page_of(sample)


def test_the_title_is_text_not_html(sample):
    text = page_of(sample, title='</title><script>alert(1)</script> & "more"')
    assert "alert(1)</script>" not in text
    assert "&lt;/title&gt;&lt;script&gt;alert(1)&lt;/script&gt; &amp; &quot;more&quot;" in text


def test_a_link_name_cannot_end_the_script(sample):
    model, visual = sample.model.copy(), sample.visual.copy()
    index = model.getFrameId("rod")
    model.frames[index].name = "</script><script>alert(2)</script>"
    text = motion_page(model, visual, [0.0], sample.configurations[:1])
    assert "alert(2)" not in text


def test_an_inlined_script_cannot_end_early():
    text = inline_script('a = "</SCRIPT>"; b = "<!-- <script>";')
    assert text == '<script>\na = "<\\/SCRIPT>"; b = "<\\!-- <script>";\n</script>'


def test_the_licences_of_what_is_inlined_come_with_it(sample):
    names = {entry["name"] for entry in json.loads(licences())}
    assert {"meshcat", "three", "dat.gui", "msgpack-lite"} <= names
    assert "Robin Deits" in page_of(sample)


def test_a_single_pose_has_no_animation(sample):
    text = motion_page(sample.model, sample.visual, [0.0], sample.configurations[:1])
    assert "set_animation" not in {command["type"] for command in commands(text)}
    assert "gui.open()" not in text


def write(sample, path) -> None:
    write_html(path, sample.model, sample.visual, sample.times, sample.configurations)


@pytest.mark.parametrize("name", ["", "missing/viewer.html"])
def test_a_place_where_no_file_can_stand_is_refused(sample, tmp_path, name):
    with pytest.raises(InputError, match="cannot write"):
        write(sample, tmp_path / name)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("blow", [KeyboardInterrupt, OSError])
def test_an_interrupted_write_leaves_the_old_file(sample, tmp_path, monkeypatch, blow):
    path = tmp_path / "viewer.html"
    path.write_text("old")

    def interrupted(self, *args, **kwargs):
        self.write_bytes(b"<!DOCTYPE")
        raise blow

    monkeypatch.setattr(html_module.Path, "write_text", interrupted)
    with pytest.raises(blow):
        write(sample, path)
    monkeypatch.undo()
    assert path.read_text() == "old"
    assert [item.name for item in tmp_path.iterdir()] == ["viewer.html"]


def test_the_file_has_ordinary_permissions(sample, tmp_path):
    ordinary, path = tmp_path / "ordinary", tmp_path / "viewer.html"
    ordinary.touch()
    write(sample, path)
    assert stat.S_IMODE(path.stat().st_mode) == stat.S_IMODE(ordinary.stat().st_mode)
