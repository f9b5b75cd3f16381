"""The recording window: everything, in order, and nothing else."""

import socket
import subprocess

import meshcat
import meshcat.geometry as mg
import numpy as np
import umsgpack

from rps_pin.viewer import RawCommand, Recorder


def test_keeps_every_command_in_order():
    recorder = Recorder()
    view = meshcat.Visualizer(window=recorder)
    view["a"].set_object(mg.Box([1.0, 2.0, 3.0]))
    view["a"].set_transform(np.diag([2.0, 2.0, 2.0, 1.0]))
    view["a"].set_property("visible", False)
    view["a"].delete()
    recorder.send(RawCommand({"type": "set_property", "path": "/b", "value": 1}))
    assert [(m["type"], m["path"]) for m in recorder.messages] == [
        ("set_object", "/meshcat/a"),
        ("set_transform", "/meshcat/a"),
        ("set_property", "/meshcat/a"),
        ("delete", "/meshcat/a"),
        ("set_property", "/b"),
    ]


def test_packed_is_the_same_in_wire_format():
    recorder = Recorder()
    meshcat.Visualizer(window=recorder)["a"].set_transform(np.eye(4))
    recorder.send(RawCommand({"type": "delete", "path": "/a"}))
    assert [umsgpack.unpackb(packed) for packed in recorder.packed()] == recorder.messages


def test_opens_neither_socket_nor_process(monkeypatch):
    def refuse(*args, **kwargs):
        raise AssertionError("a recording must not open anything")

    monkeypatch.setattr(socket.socket, "connect", refuse)
    monkeypatch.setattr(socket.socket, "bind", refuse)
    monkeypatch.setattr(subprocess, "Popen", refuse)
    monkeypatch.setattr("zmq.Context.socket", refuse)
    recorder = Recorder()
    view = meshcat.Visualizer(window=recorder)
    view["a"].set_object(mg.Sphere(1.0))
    assert len(recorder.messages) == 1
