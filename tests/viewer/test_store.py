"""What a new tab is told."""

from rps_pin.viewer.server.store import SceneStore


def apply(store: SceneStore, kind: str, path: str, packed: bytes, **more: object) -> None:
    store.apply({"type": kind, "path": path, **more}, packed)


def test_only_the_latest_of_each_kind_is_kept():
    store = SceneStore()
    apply(store, "set_object", "/a", b"object")
    for index in range(1000):
        apply(store, "set_transform", "/a", b"transform %d" % index)
    assert list(store) == [b"object", b"transform 999"]


def test_different_properties_do_not_replace_each_other():
    store = SceneStore()
    apply(store, "set_property", "/a", b"visible", property="visible")
    apply(store, "set_property", "/a", b"scale", property="scale")
    apply(store, "set_property", "/a", b"hidden", property="visible")
    assert list(store) == [b"scale", b"hidden"]


def test_a_deleted_branch_is_gone_and_its_neighbour_is_not():
    store = SceneStore()
    for path in ("/a", "/a/b", "/ab"):
        apply(store, "set_object", path, path.encode())
        apply(store, "set_transform", path, path.encode() + b" moved")
    apply(store, "delete", "/a", b"delete")
    assert list(store) == [b"/ab", b"/ab moved"]


def test_a_new_object_forgets_what_was_set_on_the_old_one():
    store = SceneStore()
    apply(store, "set_property", "/a/<object>", b"old fov", property="fov")
    apply(store, "set_property", "/a", b"visible", property="visible")
    apply(store, "set_object", "/a", b"new")
    apply(store, "set_property", "/a/<object>", b"new fov", property="fov")
    assert list(store) == [b"visible", b"new", b"new fov"]
