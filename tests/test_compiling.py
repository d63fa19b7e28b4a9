"""What is compiled ahead is what a start and a step use."""

import json
import subprocess
import sys
from pathlib import Path

# A process of its own, for in this one other tests have compiled kernels already.
SCRIPT = """
import json, sys
from numba.core.registry import CPUDispatcher
from spf.compiling import compile_kernels
from spf.prepare import prepare
from spf.sessions import open_session
from spf.track import begin, track_frame
from spf.trackers import make_settings

def compiled():
    return {
        f"{module}.{name}": len(value.signatures)
        for module, members in list(sys.modules.items()) if module.startswith("spf.kernels")
        for name, value in list(vars(members).items()) if isinstance(value, CPUDispatcher)
    }

compile_kernels()
ahead = compiled()
session = open_session(sys.argv[1])
tracking, state = begin("spf", make_settings("spf"), prepare(session, init="truth"), 0)
for index in (0, 1):
    state, _ = track_frame(tracking, state, session[index], record=True)
print(json.dumps([ahead, compiled()]))
"""


def test_a_start_after_it_compiles_nothing_more():
    sample = Path(__file__).parent.parent / "sessions" / "open-close.mcap"
    done = subprocess.run([sys.executable, "-c", SCRIPT, str(sample)], capture_output=True, text=True, check=True)
    ahead, after = json.loads(done.stdout)
    assert sum(ahead.values()) > 10
    assert after == ahead
