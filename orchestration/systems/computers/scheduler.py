"""The scheduler of processors and networks, instant by instant, in Python; scheduler.c mirrors it.

The order at one instant: jobs and frames end, and jobs write; deadlines, first those at which jobs are aborted, then
those at which outputs are written; arrivals and releases. When none of these is left, processors choose a job; if one
ends at once, everything is repeated. Finally networks choose a frame.
"""

from collections import deque
from collections.abc import Collection

import numpy as np

from orchestration.foundation.basics.simulator import Integers
from orchestration.systems.computers import note
from orchestration.systems.computers.parts import (
    ABORT,
    AT_ONCE,
    EARLIEST_DEADLINE,
    FIXED_PRIORITY,
    LATER,
    MAX_WAITING,
    NONE,
    SKIP,
    Leg,
    Parts,
    ScheduledFrame,
    ScheduledTask,
    Stream,
)


class _Numbers:
    """A stream of numbers, one by one."""

    __slots__ = ("_draw", "_drawn")

    def __init__(self, draw: Stream) -> None:
        self._draw = draw
        self._drawn: list[int] = []

    def next(self) -> int:
        if not self._drawn:
            self._drawn = self._draw(AT_ONCE).tolist()
            self._drawn.reverse()
        return self._drawn.pop()


class _Job:
    """A job that is released and has not ended."""

    __slots__ = ("deadline", "left", "nominal", "number", "released", "sample", "started")

    def __init__(self, number: int, nominal: int, released: int, deadline: int, left: int) -> None:
        self.number, self.nominal, self.released, self.deadline, self.left = number, nominal, released, deadline, left
        self.started, self.sample = False, NONE


class _TaskState:
    """The state of a task: its jobs that have not ended, the oldest first, and those that still have to write."""

    __slots__ = ("carriers", "jobs", "next_nominal", "number", "part", "sampled_at", "samples",
                 "started_at", "unwritten")  # fmt: skip

    def __init__(self, part: ScheduledTask, carriers: list[int]) -> None:
        self.part, self.carriers = part, carriers
        self.jobs: deque[_Job] = deque()
        self.unwritten: deque[_Job] = deque()
        self.number = self.samples = self.next_nominal = 0
        self.started_at = self.sampled_at = NONE


class _ProcessorState:
    """The state of a processor."""

    __slots__ = ("changed", "executing", "ready_at", "running", "tasks")

    def __init__(self, tasks: list[int]) -> None:
        self.tasks = tasks
        self.running = NONE
        """the task whose job has the processor"""
        self.executing = False
        """whether that job executes, after its switch"""
        self.ready_at = 0
        """Time at which its switch is over, or at which it started to execute"""
        self.changed = False


class _Frame:
    """A frame that is queued or under way."""

    __slots__ = ("late", "lost", "nominal", "number", "queued", "sample")

    def __init__(self, number: int, nominal: int, sample: int, late: int, lost: int) -> None:
        self.number, self.nominal, self.sample, self.late, self.lost = number, nominal, sample, late, lost
        self.queued = 0


class _LegState:
    """The state of a leg: frames that wait for its link, and those that are not in that queue yet."""

    __slots__ = ("coming", "frames", "is_last", "message", "part", "place", "rank")

    def __init__(self, message: int, place: int, of: ScheduledFrame) -> None:
        self.message, self.place, self.rank = message, place, of.rank
        self.part: Leg = of.legs[place]
        self.is_last = place == len(of.legs) - 1
        self.frames: deque[_Frame] = deque()
        self.coming: deque[tuple[int, _Frame]] = deque()


class _LinkState:
    """The state of a link."""

    __slots__ = ("changed", "corrupted", "legs", "sending", "slot", "slots")

    def __init__(self, legs: list[int], slots: int) -> None:
        self.legs, self.slots = legs, slots
        self.sending = NONE
        """the leg whose frame it carries"""
        self.corrupted = False
        self.slot = NONE
        """the slot that begins now"""
        self.changed = False


class Scheduler:
    """Processes the instants in order, and keeps notes of them."""

    def __init__(self, parts: Parts, kinds: Collection[int] = note.ALL_KINDS) -> None:
        """`kinds` are the kinds of notes that are kept."""
        self._parts, self._stop = parts, parts.stop
        self._kept = [kind in kinds for kind in range(len(note.ALL_KINDS))]
        self._notes: list[int] = []
        self._numbers = [_Numbers(stream) for stream in parts.streams]
        carriers = range(len(parts.carriers))
        self._tasks = [
            _TaskState(part, [c for c in carriers if parts.carriers[c].sender == i])
            for i, part in enumerate(parts.tasks)
        ]
        self._processors = [
            _ProcessorState([i for i, task in enumerate(parts.tasks) if task.processor == p])
            for p in range(len(parts.processors))
        ]
        self._legs = [
            _LegState(m, place, message)
            for m, message in enumerate(parts.messages)
            for place in range(len(message.legs))
        ]
        self._first_leg = [
            next(i for i, leg in enumerate(self._legs) if leg.message == m) for m in range(len(parts.messages))
        ]
        self._links = [
            _LinkState([i for i, leg in enumerate(self._legs) if leg.part.link == k], link.slots)
            for k, link in enumerate(parts.links)
        ]
        self._frame_number = [0] * len(parts.messages)
        self._message_next = [(0, 0)] * len(parts.messages)
        self._pending: list[deque[int]] = [deque() for _ in carriers]
        self._last_arrival = [0] * len(parts.carriers)

        # The next instants, one place for each cause.
        counts = [
            len(self._processors), len(self._links), len(self._tasks), len(parts.carriers), len(self._tasks),
            len(parts.messages), len(self._legs), len(self._links),
        ]  # fmt: skip
        begins = [sum(counts[:i]) for i in range(len(counts) + 1)]
        (self._busy, self._line, self._deadline, self._arrival, self._release, self._instant_of, self._hop,
         self._slot) = begins[:-1]  # fmt: skip
        self._due = [LATER] * begins[-1]
        for i, task in enumerate(parts.tasks):
            if task.nominal != NONE:
                self._draw_release(i)
        for m, message in enumerate(parts.messages):
            if message.nominal != NONE:
                self._draw_instant(m)
        for k, link in enumerate(parts.links):
            if link.slots:
                self._draw_slot(k)
        self._slots_past = [0] * len(parts.links)

    @property
    def next_instant(self) -> int:
        """The next instant [ns]; LATER if there is none up to the end."""
        due = min(self._due, default=LATER)
        return due if due <= self._stop else LATER

    def run(self, until: int) -> None:
        """Process all instants before `until` [ns], up to the end."""
        last, now = min(until - 1, self._stop), min(self._due, default=LATER)
        while now <= last:
            now = self._process_instant(now)

    def take_notes(self) -> Integers:
        """The notes since the last call, one per row: time, kind, owner, index of its job or frame, one more value."""
        found = np.array(self._notes, dtype=np.int64).reshape(-1, note.COLUMNS)
        self._notes.clear()
        return found

    def _note(self, now: int, kind: int, owner: int, item: int, extra: int) -> None:
        if self._kept[kind]:
            self._notes += (now, kind, owner, item, extra)

    # -- an instant ------------------------------------------------------------------------------------------------

    def _process_instant(self, now: int) -> int:
        """Process an instant; return a lower bound of the next one: what is due there may be postponed."""
        due, then = self._due, now
        while then == now:
            while then == now:
                self._end(now)
                self._meet_deadlines(now)
                self._arrive(now)
                then = min(due)
            if now == self._stop:
                return then
            for p, processor in enumerate(self._processors):
                if processor.changed:
                    self._dispatch(p, processor, now)
                    then = min(then, due[self._busy + p])
        for k, link in enumerate(self._links):
            if link.changed:
                self._choose_frame(k, link, now)
                then = min(then, due[self._line + k])
        return then

    def _end(self, now: int) -> None:
        due = self._due
        for p, processor in enumerate(self._processors):
            if due[self._busy + p] == now:
                due[self._busy + p] = LATER
                processor.changed = True
                if processor.executing and processor.ready_at + self._tasks[processor.running].jobs[0].left == now:
                    self._finish(processor, now)
        for k, link in enumerate(self._links):
            if due[self._line + k] == now:
                due[self._line + k] = LATER
                link.changed = True
                self._end_frame(link, now)

    def _meet_deadlines(self, now: int) -> None:
        due, late = self._due, []
        for i, task in enumerate(self._tasks):
            if due[self._deadline + i] == now:
                late.append(i)
                if task.part.overrun == ABORT:
                    while task.jobs and task.jobs[0].deadline <= now:
                        self._abort(i, task, now)
        for i in late:
            task = self._tasks[i]
            while task.unwritten and task.unwritten[0].deadline <= now:
                self._write(i, task.unwritten.popleft(), now)
            self._set_deadline(i, now)

    def _arrive(self, now: int) -> None:
        due, parts = self._due, self._parts
        for c, pending in enumerate(self._pending):
            if due[self._arrival + c] == now:
                while pending and pending[0] == now:
                    pending.popleft()
                    for i in parts.carriers[c].releases:
                        if now < self._stop:
                            self._release_job(i, now, now)
                due[self._arrival + c] = pending[0] if pending else LATER
        for i, task in enumerate(self._tasks):
            while due[self._release + i] == now:
                self._release_job(i, task.next_nominal, now)
                self._draw_release(i)
        for m, message in enumerate(parts.messages):
            while due[self._instant_of + m] == now:
                self._post(m, message, now)
                self._draw_instant(m)
        for j, leg in enumerate(self._legs):
            if due[self._hop + j] == now:
                while leg.coming and leg.coming[0][0] == now:
                    self._queue(j, leg.coming.popleft()[1], now)
                due[self._hop + j] = leg.coming[0][0] if leg.coming else LATER
        for k, link in enumerate(self._links):
            if due[self._slot + k] == now:
                link.slot, link.changed = self._slots_past[k] % link.slots, True
                self._slots_past[k] += 1
                self._draw_slot(k)

    # -- tasks -----------------------------------------------------------------------------------------------------

    def _draw_release(self, i: int) -> None:
        task = self._tasks[i]
        task.next_nominal = self._numbers[task.part.nominal].next()
        time = task.next_nominal + self._numbers[task.part.late].next()
        self._due[self._release + i] = time if time < self._stop else LATER

    def _release_job(self, i: int, nominal: int, now: int) -> None:
        """Release a job."""
        task = self._tasks[i]
        execution = self._numbers[task.part.execution].next()
        number = task.number
        task.number += 1
        if task.part.overrun == SKIP and task.jobs:
            self._note(now, note.SKIPPED, i, number, nominal)
            return
        job = _Job(number, nominal, now, nominal + task.part.deadline, execution)
        if len(task.jobs) == MAX_WAITING:
            raise self._parts.queue_overflow(i)
        task.jobs.append(job)
        self._note(now, note.RELEASED, i, number, nominal)
        if task.part.reads_at_release and task.part.overrun != ABORT:
            self._sample(i, task, job, now)
        if task.part.overrun == ABORT:
            self._set_deadline(i, now)
        self._processors[task.part.processor].changed = True

    def _sample(self, i: int, task: _TaskState, job: _Job, now: int) -> None:
        """A job reads its inputs: at its release or now, at least a nanosecond after the sample before it."""
        time = job.released if task.part.reads_at_release else now
        job.sample, task.samples = task.samples, task.samples + 1
        task.sampled_at = max(time, task.sampled_at + 1)
        if task.part.reports_samples:
            self._note(now, note.SAMPLED, i, job.number, task.sampled_at)

    def _set_deadline(self, i: int, now: int) -> None:
        task, due = self._tasks[i], LATER
        if task.part.overrun == ABORT and task.jobs:
            due = task.jobs[0].deadline
        if task.unwritten:
            due = min(due, task.unwritten[0].deadline)
        self._due[self._deadline + i] = max(due, now)

    def _finish(self, processor: _ProcessorState, now: int) -> None:
        i = processor.running
        task = self._tasks[i]
        job = task.jobs.popleft()
        processor.running, processor.executing = NONE, False
        self._note(now, note.FINISHED, i, job.number, 0)
        if task.part.writes_at_deadline and now <= job.deadline:
            task.unwritten.append(job)
        else:
            self._write(i, job, now)
        if task.part.writes_at_deadline or task.part.overrun == ABORT:
            self._set_deadline(i, now)

    def _abort(self, i: int, task: _TaskState, now: int) -> None:
        job, processor = task.jobs.popleft(), self._processors[task.part.processor]
        if processor.running == i:
            self._note(now, note.INTERRUPTED, i, job.number, 0)
            processor.running, processor.executing = NONE, False
            self._due[self._busy + task.part.processor] = LATER
        self._note(now, note.ABORTED, i, job.number, 0)
        processor.changed = True
        if job.sample != NONE:
            for c in task.carriers:
                carrier = self._parts.carriers[c]
                self._numbers[carrier.late].next()
                self._numbers[carrier.lost].next()
                self._note(now, note.SENT, c, job.sample, 2)

    def _write(self, i: int, job: _Job, now: int) -> None:
        self._note(now, note.WRITTEN, i, job.number, job.sample)
        for c in self._tasks[i].carriers:
            self._send(c, job.sample, now, now)

    # -- processors ------------------------------------------------------------------------------------------------

    def _dispatch(self, p: int, processor: _ProcessorState, now: int) -> None:
        """Give the processor to the job of the highest rank, which executes when its switch is over."""
        processor.changed = False
        part, waits = self._parts.processors[p], False
        chosen, least = processor.running, None
        if chosen != NONE:
            least = self._order(part.policy, chosen)
        if chosen == NONE or part.preemptive:
            for i in processor.tasks:
                task = self._tasks[i]
                if i == processor.running or not task.jobs:
                    continue
                if task.started_at == now and not (part.switch or task.jobs[0].started):
                    waits = True  # jobs of one task start a nanosecond apart
                    continue
                order = self._order(part.policy, i)
                if least is None or order < least:
                    chosen, least = i, order
        if chosen != processor.running:
            self._preempt(processor, now)
            processor.running, processor.ready_at = chosen, now + part.switch
            if part.switch:
                self._note(now, note.SWITCHING, chosen, self._tasks[chosen].jobs[0].number, 0)
        then = LATER
        if processor.running != NONE:
            if not processor.executing and processor.ready_at <= now:
                self._resume(processor, now)
            left = self._tasks[processor.running].jobs[0].left if processor.executing else 0
            then = processor.ready_at + left
        self._due[self._busy + p] = min(then, now + 1) if waits else then

    def _order(self, policy: int, i: int) -> tuple[int, ...]:
        task = self._tasks[i]
        job, priority = task.jobs[0], task.part.priority
        if policy == FIXED_PRIORITY:
            return priority, job.released, i
        if policy == EARLIEST_DEADLINE:
            return job.deadline, priority, job.released, i
        return job.released, priority, i

    def _preempt(self, processor: _ProcessorState, now: int) -> None:
        """Take the processor from the job that has it, if any."""
        i = processor.running
        if i == NONE:
            return
        job = self._tasks[i].jobs[0]
        if processor.executing:
            job.left -= now - processor.ready_at
            self._note(now, note.PREEMPTED, i, job.number, 0)
        else:
            self._note(now, note.INTERRUPTED, i, job.number, 0)
        processor.running, processor.executing = NONE, False

    def _resume(self, processor: _ProcessorState, now: int) -> None:
        """Execute the job that has the processor: its switch is over."""
        i = processor.running
        task = self._tasks[i]
        job = task.jobs[0]
        processor.executing, processor.ready_at = True, now
        self._note(now, note.RESUMED if job.started else note.STARTED, i, job.number, 0)
        if not job.started:
            job.started, task.started_at = True, now
            if job.sample == NONE:
                self._sample(i, task, job, now)

    # -- messages --------------------------------------------------------------------------------------------------

    def _draw_instant(self, m: int) -> None:
        message = self._parts.messages[m]
        nominal = self._numbers[message.nominal].next()
        time = nominal + self._numbers[message.late].next()
        self._message_next[m] = nominal, time
        self._due[self._instant_of + m] = time if time < self._stop else LATER

    def _draw_slot(self, k: int) -> None:
        time = self._numbers[self._parts.links[k].begins].next()
        self._due[self._slot + k] = time if time < self._stop else LATER

    def _post(self, m: int, message: ScheduledFrame, now: int) -> None:
        """Send a message at its instant."""
        nominal, _ = self._message_next[m]
        if message.carrier == NONE:
            self._enqueue(m, _Frame(self._frame_number[m], nominal, NONE, 0, 0), now)
        else:
            self._send(message.carrier, self._frame_number[m], nominal, now)

    def _send(self, c: int, sample: int, nominal: int, now: int) -> None:
        """Send a message of a connection."""
        carrier = self._parts.carriers[c]
        late, lost = self._numbers[carrier.late].next(), self._numbers[carrier.lost].next()
        self._note(now, note.SENT, c, sample, lost)
        if carrier.message == NONE:
            self._receive(c, sample, late, lost, now)
        else:
            m = carrier.message
            self._enqueue(m, _Frame(self._frame_number[m], nominal, sample, late, lost), now)

    def _receive(self, c: int, sample: int, late: int, lost: int, now: int) -> None:
        """A message is received; the delay of its connection counts from here. Messages never overtake each other."""
        if lost:
            return
        arrival = self._last_arrival[c] = max(self._last_arrival[c], now + late)
        self._note(now, note.ARRIVES, c, sample, arrival)
        if self._parts.carriers[c].releases:
            self._pending[c].append(arrival)
            self._due[self._arrival + c] = self._pending[c][0]

    def _enqueue(self, m: int, frame: _Frame, now: int) -> None:
        self._frame_number[m] += 1
        self._note(now, note.QUEUED, m, frame.number, frame.nominal)
        self._queue(self._first_leg[m], frame, now)

    def _queue(self, j: int, frame: _Frame, now: int) -> None:
        leg = self._legs[j]
        frame.queued = now
        if len(leg.frames) == MAX_WAITING:
            raise self._parts.queue_overflow(len(self._tasks) + leg.message)
        leg.frames.append(frame)
        self._links[leg.part.link].changed = True

    def _choose_frame(self, k: int, link: _LinkState, now: int) -> None:
        """A free link starts the first frame in its order; with slots, of those in the slot that begins."""
        link.changed = False
        chosen, least = NONE, None
        if link.sending == NONE and (link.slot != NONE or not link.slots):
            for j in link.legs:
                leg = self._legs[j]
                if not leg.frames or (link.slots and leg.part.slot != link.slot):
                    continue
                order = (leg.rank, leg.frames[0].queued, leg.message)
                if least is None or order < least:
                    chosen, least = j, order
        link.slot = NONE
        if chosen == NONE:
            return
        leg, message = self._legs[chosen], self._parts.messages[self._legs[chosen].message]
        link.sending, link.corrupted = chosen, bool(self._numbers[message.corrupted].next())
        length = leg.part.corrupted_length if link.corrupted else leg.part.length
        self._due[self._line + k] = now + length
        self._note(now, note.FRAME_STARTED, leg.message, leg.frames[0].number, leg.place)

    def _end_frame(self, link: _LinkState, now: int) -> None:
        """The last bit of a frame is transmitted."""
        j, link.sending = link.sending, NONE
        leg = self._legs[j]
        message = self._parts.messages[leg.message]
        if link.corrupted:
            self._note(now, note.FRAME_CORRUPTED, leg.message, leg.frames[0].number, leg.place)
            return
        frame = leg.frames.popleft()
        self._note(now, note.FRAME_TRANSMITTED, leg.message, frame.number, leg.place)
        if not leg.is_last:
            self._legs[j + 1].coming.append((now + message.pause, frame))
            self._due[self._hop + j + 1] = self._legs[j + 1].coming[0][0]
        elif message.carrier != NONE:
            self._receive(message.carrier, frame.sample, frame.late, frame.lost, now)
