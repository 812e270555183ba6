"""How many steps of environments a second on one core: `python -m benchmarks.environments [ENVIRONMENTS …]`.

A step is 10 ms of the paper's flight, ten steps of its plant, with the reward and the observation. The policy is a
constant action, so that what is measured is the environment; seconds are those of the processor.
"""

import sys
import time

import gymnasium
import numpy as np

import quadcosim.gym  # registers them

NAME, STEPS, REPEATS = quadcosim.gym.NAME, 200, 5
HOVER = [9.81, 0.0, 0.0, 0.0]


def main() -> None:
    print("| environments | steps a second | us a step | us to begin an episode |")
    print("|---|---|---|---|")
    one = gymnasium.make(NAME).unwrapped
    one.reset(seed=0)
    begun = _seconds(lambda: one.reset(seed=0))
    _row("1, `make`", _seconds(lambda: [one.step(HOVER) for _ in range(STEPS)]) / STEPS, begun)
    one.close()
    for count in map(int, sys.argv[1:] or ("8", "64", "1024")):
        many, actions = gymnasium.make_vec(NAME, num_envs=count), np.tile(HOVER, (count, 1))
        many.reset(seed=0)
        begun = _seconds(lambda many=many: many.reset(seed=0)) / count
        each = min(
            _seconds(lambda many=many, actions=actions: [many.step(actions) for _ in range(STEPS)])
            for _ in range(REPEATS)
        )
        _row(f"{count:,}, `make_vec`", each / STEPS / count, begun)
        many.close()


def _seconds(call) -> float:  # type: ignore[no-untyped-def]
    started = time.process_time()
    call()
    return time.process_time() - started


def _row(name: str, step: float, begun: float) -> None:
    print(f"| {name} | {1.0 / step:,.0f} | {step * 1e6:.2f} | {begun * 1e6:.0f} |", flush=True)


if __name__ == "__main__":
    main()
