"""The recipes of the page on controllers in C, with code that is written like what they are for."""

import re
from pathlib import Path

import numpy as np

from orchestration.components.building import wrap
from orchestration.components.fmi.opening import open_here
from orchestration.components.fmi.read_description import read_model
from tests.places import ROOT

PAGE = (ROOT / "docs" / "controller_in_c.md").read_text()
CODER = {
    "rtwtypes.h": "typedef double real_T;\ntypedef unsigned char uint8_T;\ntypedef const char *char_T;\n",
    "autopilot.h": """\
#ifndef autopilot_h_
#define autopilot_h_
#include "rtwtypes.h"
typedef struct tag_RTM_autopilot_T RT_MODEL_autopilot_T;
typedef struct { real_T UnitDelay_DSTATE; uint8_T is_active; } DW_autopilot_T;
typedef struct { real_T position[3]; } ExtU_autopilot_T;
typedef struct { real_T thrust; } ExtY_autopilot_T;
struct P_autopilot_T_ { real_T Gain_Gain; real_T UnitDelay_InitialCondition; };
typedef struct P_autopilot_T_ P_autopilot_T;
struct tag_RTM_autopilot_T { char_T errorStatus; };
extern P_autopilot_T autopilot_P;
extern DW_autopilot_T autopilot_DW;
extern ExtU_autopilot_T autopilot_U;
extern ExtY_autopilot_T autopilot_Y;
extern void autopilot_initialize(void);
extern void autopilot_step(void);
extern void autopilot_terminate(void);
extern RT_MODEL_autopilot_T *const autopilot_M;
#endif
""",
    "autopilot_data.c": '#include "autopilot.h"\nP_autopilot_T autopilot_P = { -2.0, 0.5 };\n',
    "autopilot.c": """\
#include "autopilot.h"
#include <string.h>
DW_autopilot_T autopilot_DW;
ExtU_autopilot_T autopilot_U;
ExtY_autopilot_T autopilot_Y;
static RT_MODEL_autopilot_T autopilot_M_;
RT_MODEL_autopilot_T *const autopilot_M = &autopilot_M_;
void autopilot_step(void)
{
    autopilot_Y.thrust = autopilot_P.Gain_Gain * autopilot_U.position[0] + autopilot_DW.UnitDelay_DSTATE;
    autopilot_DW.UnitDelay_DSTATE = autopilot_U.position[0];
}
void autopilot_initialize(void)
{
    (void)memset((void *)&autopilot_U, 0, sizeof(ExtU_autopilot_T));
    autopilot_DW.UnitDelay_DSTATE = autopilot_P.UnitDelay_InitialCondition;
}
void autopilot_terminate(void) {}
""",
}
FILTER = {
    "arm_math.h": """\
#include <stdint.h>
typedef float float32_t;
typedef struct { uint32_t numStages; float32_t *pState; const float32_t *pCoeffs; } arm_biquad_casd_df1_inst_f32;
void arm_biquad_cascade_df1_init_f32(arm_biquad_casd_df1_inst_f32 *, uint8_t, const float32_t *, float32_t *);
void arm_biquad_cascade_df1_f32(const arm_biquad_casd_df1_inst_f32 *, const float32_t *, float32_t *, uint32_t);
""",
    "arm_biquad_cascade_df1_f32.c": """\
#include "arm_math.h"
#include <string.h>
void arm_biquad_cascade_df1_init_f32(arm_biquad_casd_df1_inst_f32 *S, uint8_t n, const float32_t *c, float32_t *state)
{
    S->numStages = n;
    S->pCoeffs = c;
    memset(state, 0, 4U * n * sizeof(float32_t));
    S->pState = state;
}
void arm_biquad_cascade_df1_f32(const arm_biquad_casd_df1_inst_f32 *S, const float32_t *src, float32_t *dst, uint32_t n)
{
    const float32_t *b = S->pCoeffs;
    float32_t *s = S->pState;
    for (; n--; src++, dst++) {
        const float32_t y = b[0] * *src + b[1] * s[0] + b[2] * s[1] + b[3] * s[2] + b[4] * s[3];
        s[1] = s[0], s[0] = *src, s[3] = s[2], s[2] = y;
        *dst = y;
    }
}
""",
    "loop.c": """\
#include <stdio.h>
unsigned long micros(void);
float dt;
void loop(void)
{
    static unsigned long last;
    const unsigned long now = micros();
    dt = 1e-6f * (float)(now - last);
    last = now;
    printf("%f", dt);
}
""",
}
LOOP = """\
name = "Loop"
period = 0.0025
sources = ["arm_biquad_cascade_df1_f32.c", {sources}]
headers = ["arm_math.h"]
declare = '''
{notch}
{stub}
extern float dt; void loop(void);
'''
init = '''
coefficients[0] = 0.5f, coefficients[3] = 0.5f;
{begin}
'''
step = '''
{step}
{filter}
'''
[inputs]
raw = "in"
[outputs]
filtered = "out"
dt = "dt"
"""


def block(language: str, heading: str) -> str:
    """The first block of a language under a heading of the page."""
    under = PAGE.partition(f"## {heading}\n")[2]
    found = re.search(rf"```{language}\n(.*?)```", under, re.DOTALL)
    assert found is not None
    return found[1]


def quoted(key: str, text: str) -> str:
    """What the page says that a key is: the first word of it."""
    found = re.search(rf"{key} = (\[.*?\]|\".*?\")", text, re.DOTALL)
    assert found is not None
    return found[1].strip('"') if found[1].startswith('"') else found[1]


def quoted_code(name: str, text: str) -> str:
    """The function of a name that the page has in a sentence."""
    found = re.search(rf"`(\w+ {name}\(.*?)`", text)
    assert found is not None
    return found[1]


def written(folder: Path, files: dict[str, str]) -> None:
    """Write files into a folder, which is made."""
    folder.mkdir()
    for name, text in files.items():
        (folder / name).write_text(text)


def outputs(fmu: Path, name: str, inputs: list[float], *of: str) -> list[list[float]]:
    """The outputs after each step with a value of an input."""
    instance = open_here(fmu, "it")
    instance.enter_initialization(0.0, 1e9)
    given, found = np.zeros(1), np.zeros(len(of))
    write, read = instance.writer((name,), given), instance.reader(of, found)
    instance.exit_initialization()
    rows = []
    for k, value in enumerate(inputs):
        given[0] = value
        write()
        instance.step(float(k), 1.0)
        read()
        rows.append(found.tolist())
    return rows


def test_code_as_simulink_coder_writes_it(tmp_path: Path) -> None:
    written(tmp_path / "autopilot_ert_rtw", CODER)
    file = tmp_path / "autopilot.toml"
    file.write_text(block("toml", "Simulink Coder (`ert`)"))
    fmu = wrap.build(file, wrap.fmu_of(file))
    model = read_model(fmu)
    assert (model.variables["k_p"].start, model.saves_state, model.once_per_process) == ("-2.0", True, False)
    assert outputs(fmu, "position.x", [1.0, 3.0], "thrust") == [[-2.0 + 0.5], [-6.0 + 1.0]]


def test_a_filter_like_those_of_cmsis_in_a_loop_that_reads_the_time(tmp_path: Path) -> None:
    time, notch = PAGE.partition("## A loop that reads the time itself\n")[2], block("toml", "CMSIS-DSP")
    stubs = f"{block('c', 'A loop that reads the time itself')}{quoted_code('printf', time)}"
    written(tmp_path / "it", {**FILTER, "clock_stub.c": stubs})
    told = {
        "sources": quoted("sources", time)[1:-1],
        "notch": quoted("declare", notch),
        "stub": quoted("declare", time),
        "begin": quoted("init", notch),
        "step": quoted("step", time),
        "filter": quoted("step", notch),
    }
    file = tmp_path / "it" / "loop.toml"
    file.write_text(LOOP.format(**told))
    fmu = wrap.build(file, wrap.fmu_of(file))
    assert read_model(fmu).saves_state
    rows = outputs(fmu, "raw", [1.0, 0.0, 0.0], "filtered", "dt")
    assert rows == [[0.5 * 0.5**k, float(np.float32(1e-6) * np.float32(2500))] for k in range(3)]
