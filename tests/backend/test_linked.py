"""Functions that are compiled only into the loops that call them."""

from __future__ import annotations

import os
import subprocess
import sys
import textwrap
from pathlib import Path

import numpy as np
import pytest
from numba.core import event
from numba.core.targetconfig import Option, TargetConfig

from cfddem.backend.compile import inline, part, prange, serial, threaded_part, use_threads
from closures.linked import compare_quickly

pytestmark = pytest.mark.skipif(not hasattr(inline(lambda x: x), "signatures"), reason="compilation is switched off")


@inline
def raised(x, twice):  # type: ignore[no-untyped-def]
    return 2.0 * x if twice else x


@part
def raise_all(values, by, twice):  # type: ignore[no-untyped-def]
    for n in prange(len(values)):
        values[n] = raised(values[n], twice) + by


@threaded_part
def raise_on_threads(values, by):  # type: ignore[no-untyped-def]
    for n in prange(len(values)):
        values[n] = raised(values[n], False) + by


@serial
def sum_of(values):  # type: ignore[no-untyped-def]
    if values[0] > 1e9:
        raise ValueError("too large", values[0])
    return values.sum()


@serial
def walk(values):  # type: ignore[no-untyped-def]
    raise_all(values, 1, True)
    raise_all(values, 2, False)
    return sum_of(values)


@serial
def walk_on_threads(values):  # type: ignore[no-untyped-def]
    raise_on_threads(values, 1.0)
    return sum_of(values)


def test_a_part_is_compiled_once_for_all_constants_that_loops_give_it() -> None:
    values = np.ones(5)
    assert walk(values) == 25.0
    assert len(raise_all.signatures) <= 1  # none where the loop was read from the disk


def test_a_loop_that_other_loops_call_runs_by_itself_too() -> None:
    assert sum_of(np.ones(5)) == walk(np.full(5, -1.0)) + 0.0 == 5.0


def test_parts_have_no_machine_code() -> None:
    one = part(raise_all.py_func)
    one.compile("(float64[::1], int64, boolean)")
    code = one.overloads[one.signatures[0]].library
    assert code.get_pointer_to_function(next(code.get_defined_functions()).name) == 0


@pytest.mark.parametrize("threads", [1, use_threads(None)])
def test_parts_run_on_threads(threads: int) -> None:
    before = use_threads(None)
    use_threads(threads)
    try:
        assert walk_on_threads(np.ones(1000)) == 2000.0
    finally:
        use_threads(before)


def test_errors_of_parts_keep_their_values(tmp_path: Path) -> None:
    """Also in a loop that is read from the disk."""
    (tmp_path / "steps.py").write_text(
        textwrap.dedent("""
            import numpy as np
            from cfddem.backend.compile import part, serial

            @part
            def refuse(values):
                if values[0] > 1.0:
                    raise ValueError("too large", values[0])

            @serial
            def walk(values):
                refuse(values)

            try:
                walk(np.full(3, 7.5))
            except ValueError as error:
                print(error.args, walk.called.stats.cache_hits.total())
        """)
    )
    answers = [
        subprocess.run([sys.executable, "steps.py"], cwd=tmp_path, capture_output=True, text=True, check=True).stdout
        for _ in range(2)
    ]
    assert answers == ["('too large', 7.5) 0\n", "('too large', 7.5) 1\n"]


@pytest.mark.parametrize("replaced", [True, False])
def test_a_version_without_the_replaced_parts_gives_the_same_numbers(replaced: bool, tmp_path: Path) -> None:
    script = f"""
        from numba.core.codegen import JITCodeLibrary
        from closures import linked

        linked.PART, linked.CALLED = linked.ways(JITCodeLibrary if {replaced} else object)
        linked.INLINE = {{**linked.PART, "forceinline": True, "_nrt": False}}
        assert linked.PART["pipeline_class"].__name__ == {"Linked" if replaced else "Compiler"!r}

        import numpy as np
        from cfddem.backend.compile import inline, part, prange, serial

        @inline
        def rooted(x):
            return (1.0 + x) ** 0.5

        @part
        def root_all(values):
            for n in prange(len(values)):
                values[n] = rooted(values[n])

        @serial
        def walk(values):
            root_all(values)
            return values.sum()

        print(walk(np.arange(5.0)).hex())
    """
    (tmp_path / "script.py").write_text(textwrap.dedent(script), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path), "XDG_CACHE_HOME": str(tmp_path)}
    done = subprocess.run(
        [sys.executable, "script.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.stdout.strip() == sum(np.sqrt(1.0 + np.arange(5.0))).hex(), done.stderr


def test_nobody_is_told_each_time_that_llvm_is_called() -> None:
    with event.install_recorder("numba:llvm_lock") as reports:
        inline(raised.py_func).compile("(float64, boolean)")
    assert not reports.buffer


def test_settings_are_compared_by_what_is_set_and_else_as_the_compiler_does() -> None:
    class Settings(TargetConfig):
        level = Option(type=int, default=2, doc="")
        fast = Option(type=bool, default=False, doc="")

        def __eq__(self, other: object) -> bool:
            asked.append(other)
            return super().__eq__(other) is True

    def made(**values: int) -> Settings:
        settings = Settings()
        settings._values.update(values)
        return settings

    asked: list[object] = []
    pairs = [({}, {"level": 2}), ({"level": 3}, {"level": 3}), ({"level": 3}, {}), ({"level": 3}, {"fast": True})]
    alike = [made(**one) == made(**other) for one, other in pairs]
    assert alike == [True, True, False, False] and len(asked) == 4
    compare_quickly(Settings)
    assert alike == [made(**one) == made(**other) for one, other in pairs] and len(asked) == 4
    assert len({hash(made(**values)) for pair in pairs for values in pair}) == 1
    assert made() != 2 and len(asked) == 5
