/* The scheduler of scheduler.py, to the bit. constants.h is generated from parts.py and note.py, with a name for each
   column of the tables of parts. Python provides more numbers of a stream, and room for notes, when there are none left. */

#include <stdint.h>
#include <stdlib.h>
#include <string.h>

#include "constants.h"

typedef struct {
    int64_t number, nominal, released, deadline, left, sample, started;
} Job;

typedef struct {
    int64_t number, nominal, sample, late, lost, queued, coming;
} Frame;

typedef struct { /* first in, first out */
    char *items;
    int64_t size, capacity, first, count;
} Queue;

typedef struct {
    Queue jobs, unwritten;
    int64_t number, samples, next_nominal, started_at, sampled_at;
} TaskState;

typedef struct {
    int64_t running, executing, ready_at, changed;
} ProcessorState;

typedef struct {
    Queue frames, coming;
} LegState;

typedef struct {
    int64_t sending, corrupted, slot, slots_past, changed;
} LinkState;

typedef struct {
    Queue pending;
    int64_t last_arrival;
} CarrierState;

typedef struct {
    int64_t number, next_nominal, first_leg;
} MessageState;

typedef struct {
    int64_t stop;
    int64_t counts[PART_KINDS];
    const int64_t *processors, *tasks, *carriers, *releases, *messages, *legs, *links;
    int64_t **numbers; /* of each stream, AT_ONCE of them */
    int64_t *used;     /* how many of these are used, or IS_CONSTANT */
    int64_t *notes, room, note_count;
    const uint8_t *kept; /* which kinds of notes are kept */
    void (*draw)(int64_t stream);
    void (*take)(int64_t note_count);
} Arguments;

typedef struct {
    Arguments g;
    TaskState *tasks;
    ProcessorState *processors;
    LegState *legs;
    LinkState *links;
    CarrierState *carriers;
    MessageState *messages;
    int64_t *due, due_count;
    int64_t *busy, *line, *deadline, *arrival, *release, *instant, *hop, *slot; /* parts of due */
    int has_deadlines; /* whether any task writes or aborts at its deadline */
    int no_memory;
    int64_t queue_overflow; /* the task, or after all tasks the message, of which too many wait */
} Scheduler;

/* -- queues, numbers, notes ---------------------------------------------------------------------------------------- */

static void *at(const Queue *q, int64_t i) { return q->items + ((q->first + i) & (q->capacity - 1)) * q->size; }

static void *head(const Queue *q) { return at(q, 0); }

static void drop(Queue *q) { q->first++, q->count--; }

static void grow(Scheduler *s, Queue *q) {
    int64_t capacity = q->capacity ? 2 * q->capacity : 8;
    char *items = malloc((size_t)(capacity * q->size));
    if (!items) {
        s->no_memory = 1;
        return;
    }
    for (int64_t i = 0; i < q->count; i++) memcpy(items + i * q->size, at(q, i), (size_t)q->size);
    free(q->items);
    q->items = items, q->capacity = capacity, q->first = 0;
}

#define PUSH(s, q, item)                                                  \
    do {                                                                  \
        if ((q)->count == (q)->capacity) grow(s, q);                      \
        if ((q)->count < (q)->capacity) {                                 \
            (q)->count++;                                                 \
            memcpy(at(q, (q)->count - 1), item, sizeof *(item));          \
        }                                                                 \
    } while (0)

static int has_room(Scheduler *s, const Queue *q, int64_t owner) {
    if (q->count < MAX_WAITING) return 1;
    s->queue_overflow = owner, s->no_memory = 1;
    return 0;
}

static int64_t number(Scheduler *s, int64_t stream) {
    int64_t used = s->g.used[stream];
    if (used == IS_CONSTANT) return s->g.numbers[stream][0];
    if (used == AT_ONCE) s->g.draw(stream), used = 0;
    s->g.used[stream] = used + 1;
    return s->g.numbers[stream][used];
}

static void note(Scheduler *s, int64_t now, int64_t kind, int64_t owner, int64_t item, int64_t extra) {
    if (!s->g.kept[kind]) return;
    if (s->g.note_count == s->g.room) s->g.take(s->g.note_count), s->g.note_count = 0;
    int64_t *row = s->g.notes + COLUMNS * s->g.note_count++;
    row[0] = now, row[1] = kind, row[2] = owner, row[3] = item, row[4] = extra;
}

static int64_t least(const int64_t *values, int64_t count) {
    int64_t found = LATER;
    for (int64_t i = 0; i < count; i++) found = values[i] < found ? values[i] : found;
    return found;
}

#define TASK(i, column) (s->g.tasks[(i) * TASK_COLUMNS + TASK_##column])
#define PROCESSOR(i, column) (s->g.processors[(i) * PROCESSOR_COLUMNS + PROCESSOR_##column])
#define CARRIER(i, column) (s->g.carriers[(i) * CARRIER_COLUMNS + CARRIER_##column])
#define MESSAGE(i, column) (s->g.messages[(i) * MESSAGE_COLUMNS + MESSAGE_##column])
#define LEG(i, column) (s->g.legs[(i) * LEG_COLUMNS + LEG_##column])
#define LINK(i, column) (s->g.links[(i) * LINK_COLUMNS + LINK_##column])
#define EACH(i, part) for (int64_t i = 0; i < s->g.counts[part]; i++)

/* -- messages ------------------------------------------------------------------------------------------------------ */

static void draw_instant(Scheduler *s, int64_t m) {
    int64_t nominal = number(s, MESSAGE(m, NOMINAL)), time = nominal + number(s, MESSAGE(m, LATE));
    s->messages[m].next_nominal = nominal;
    s->instant[m] = time < s->g.stop ? time : LATER;
}

static void draw_slot(Scheduler *s, int64_t k) {
    int64_t time = number(s, LINK(k, BEGINS));
    s->slot[k] = time < s->g.stop ? time : LATER;
}

static void queue_frame(Scheduler *s, int64_t j, Frame *frame, int64_t now) {
    frame->queued = now;
    if (!has_room(s, &s->legs[j].frames, s->g.counts[TASKS] + LEG(j, MESSAGE))) return;
    PUSH(s, &s->legs[j].frames, frame);
    s->links[LEG(j, LINK)].changed = 1;
}

static void enqueue(Scheduler *s, int64_t m, int64_t nominal, int64_t sample, int64_t late, int64_t lost, int64_t now) {
    Frame frame = {s->messages[m].number++, nominal, sample, late, lost, 0, 0};
    note(s, now, QUEUED, m, frame.number, nominal);
    queue_frame(s, s->messages[m].first_leg, &frame, now);
}

static void receive(Scheduler *s, int64_t c, int64_t sample, int64_t late, int64_t lost, int64_t now) {
    if (lost) return;
    CarrierState *carrier = &s->carriers[c];
    int64_t own = now + late;
    if (own > carrier->last_arrival) carrier->last_arrival = own;
    note(s, now, ARRIVES, c, sample, carrier->last_arrival);
    if (CARRIER(c, RELEASES_END) > CARRIER(c, RELEASES)) {
        PUSH(s, &carrier->pending, &carrier->last_arrival);
        if (!s->no_memory) s->arrival[c] = *(int64_t *)head(&carrier->pending);
    }
}

static void send(Scheduler *s, int64_t c, int64_t sample, int64_t nominal, int64_t now) {
    int64_t late = number(s, CARRIER(c, LATE)), lost = number(s, CARRIER(c, LOST));
    note(s, now, SENT, c, sample, lost);
    if (CARRIER(c, MESSAGE) == NONE)
        receive(s, c, sample, late, lost, now);
    else
        enqueue(s, CARRIER(c, MESSAGE), nominal, sample, late, lost, now);
}

static void post(Scheduler *s, int64_t m, int64_t now) {
    int64_t nominal = s->messages[m].next_nominal;
    if (MESSAGE(m, CARRIER) == NONE)
        enqueue(s, m, nominal, NONE, 0, 0, now);
    else
        send(s, MESSAGE(m, CARRIER), s->messages[m].number, nominal, now);
}

static void choose_frame(Scheduler *s, int64_t k, int64_t now) {
    LinkState *link = &s->links[k];
    int64_t chosen = NONE, rank = 0, queued = 0, slots = LINK(k, SLOTS);
    link->changed = 0;
    if (link->sending == NONE && (link->slot != NONE || !slots))
        EACH(j, LEGS) { /* in the order of messages */
            if (LEG(j, LINK) != k || !s->legs[j].frames.count || (slots && LEG(j, SLOT) != link->slot)) continue;
            int64_t own = MESSAGE(LEG(j, MESSAGE), RANK), since = ((Frame *)head(&s->legs[j].frames))->queued;
            if (chosen == NONE || own < rank || (own == rank && since < queued)) chosen = j, rank = own, queued = since;
        }
    link->slot = NONE;
    if (chosen == NONE) return;
    int64_t m = LEG(chosen, MESSAGE);
    link->sending = chosen, link->corrupted = number(s, MESSAGE(m, CORRUPTED)) != 0;
    s->line[k] = now + (link->corrupted ? LEG(chosen, CORRUPTED_LENGTH) : LEG(chosen, LENGTH));
    note(s, now, FRAME_STARTED, m, ((Frame *)head(&s->legs[chosen].frames))->number, LEG(chosen, PLACE));
}

static void end_frame(Scheduler *s, LinkState *link, int64_t now) {
    int64_t j = link->sending, m = LEG(j, MESSAGE);
    Frame frame = *(Frame *)head(&s->legs[j].frames);
    link->sending = NONE;
    if (link->corrupted) {
        note(s, now, FRAME_CORRUPTED, m, frame.number, LEG(j, PLACE));
        return;
    }
    drop(&s->legs[j].frames);
    note(s, now, FRAME_TRANSMITTED, m, frame.number, LEG(j, PLACE));
    if (!LEG(j, IS_LAST)) {
        frame.coming = now + MESSAGE(m, PAUSE);
        PUSH(s, &s->legs[j + 1].coming, &frame);
        if (!s->no_memory) s->hop[j + 1] = ((Frame *)head(&s->legs[j + 1].coming))->coming;
    } else if (MESSAGE(m, CARRIER) != NONE)
        receive(s, MESSAGE(m, CARRIER), frame.sample, frame.late, frame.lost, now);
}

/* -- tasks --------------------------------------------------------------------------------------------------------- */

static Job *first_job(Scheduler *s, int64_t i) { return head(&s->tasks[i].jobs); }

static void draw_release(Scheduler *s, int64_t i) {
    int64_t nominal = number(s, TASK(i, NOMINAL)), time = nominal + number(s, TASK(i, LATE));
    s->tasks[i].next_nominal = nominal;
    s->release[i] = time < s->g.stop ? time : LATER;
}

static void sample(Scheduler *s, int64_t i, Job *job, int64_t now) {
    TaskState *task = &s->tasks[i];
    int64_t time = TASK(i, READS_AT_RELEASE) ? job->released : now;
    job->sample = task->samples++;
    task->sampled_at = time > task->sampled_at + 1 ? time : task->sampled_at + 1;
    if (TASK(i, REPORTS_SAMPLES)) note(s, now, SAMPLED, i, job->number, task->sampled_at);
}

static void set_deadline(Scheduler *s, int64_t i, int64_t now) {
    TaskState *task = &s->tasks[i];
    int64_t due = LATER;
    if (TASK(i, OVERRUN) == ABORT && task->jobs.count) due = first_job(s, i)->deadline;
    if (task->unwritten.count && ((Job *)head(&task->unwritten))->deadline < due)
        due = ((Job *)head(&task->unwritten))->deadline;
    s->deadline[i] = due > now ? due : now;
}

static void release_job(Scheduler *s, int64_t i, int64_t nominal, int64_t now) {
    TaskState *task = &s->tasks[i];
    int64_t execution = number(s, TASK(i, EXECUTION)), job_number = task->number++;
    if (TASK(i, OVERRUN) == SKIP && task->jobs.count) {
        note(s, now, SKIPPED, i, job_number, nominal);
        return;
    }
    Job job = {job_number, nominal, now, nominal + TASK(i, DEADLINE), execution, NONE, 0};
    if (!has_room(s, &task->jobs, i)) return;
    PUSH(s, &task->jobs, &job);
    if (s->no_memory) return;
    note(s, now, RELEASED, i, job_number, nominal);
    if (TASK(i, READS_AT_RELEASE) && TASK(i, OVERRUN) != ABORT)
        sample(s, i, at(&task->jobs, task->jobs.count - 1), now);
    if (TASK(i, OVERRUN) == ABORT) set_deadline(s, i, now);
    s->processors[TASK(i, PROCESSOR)].changed = 1;
}

static void write_outputs(Scheduler *s, int64_t i, const Job *job, int64_t now) {
    note(s, now, WRITTEN, i, job->number, job->sample);
    EACH(c, CARRIERS) if (CARRIER(c, SENDER) == i) send(s, c, job->sample, now, now);
}

static void finish(Scheduler *s, ProcessorState *processor, int64_t now) {
    int64_t i = processor->running;
    TaskState *task = &s->tasks[i];
    Job job = *first_job(s, i);
    drop(&task->jobs);
    processor->running = NONE, processor->executing = 0;
    note(s, now, FINISHED, i, job.number, 0);
    if (TASK(i, WRITES_AT_DEADLINE) && now <= job.deadline)
        PUSH(s, &task->unwritten, &job);
    else
        write_outputs(s, i, &job, now);
    if (TASK(i, WRITES_AT_DEADLINE) || TASK(i, OVERRUN) == ABORT) set_deadline(s, i, now);
}

static void abort_job(Scheduler *s, int64_t i, int64_t now) {
    ProcessorState *processor = &s->processors[TASK(i, PROCESSOR)];
    Job job = *first_job(s, i);
    drop(&s->tasks[i].jobs);
    if (processor->running == i) {
        note(s, now, INTERRUPTED, i, job.number, 0);
        processor->running = NONE, processor->executing = 0;
        s->busy[TASK(i, PROCESSOR)] = LATER;
    }
    note(s, now, ABORTED, i, job.number, 0);
    processor->changed = 1;
    if (job.sample == NONE) return;
    EACH(c, CARRIERS) {
        if (CARRIER(c, SENDER) != i) continue;
        number(s, CARRIER(c, LATE)), number(s, CARRIER(c, LOST));
        note(s, now, SENT, c, job.sample, 2);
    }
}

/* -- processors ---------------------------------------------------------------------------------------------------- */

/* Whether the job of task i ranks before that of task j; tasks are in the order of the file. */
static int precedes(Scheduler *s, int64_t policy, int64_t i, int64_t j) {
    const Job *a = first_job(s, i), *b = first_job(s, j);
    int64_t p = TASK(i, PRIORITY), q = TASK(j, PRIORITY);
    if (policy == FIRST_COME) {
        if (a->released != b->released) return a->released < b->released;
        return p != q ? p < q : i < j;
    }
    if (policy == EARLIEST_DEADLINE && a->deadline != b->deadline) return a->deadline < b->deadline;
    if (p != q) return p < q;
    return a->released != b->released ? a->released < b->released : i < j;
}

static void preempt(Scheduler *s, ProcessorState *processor, int64_t now) {
    int64_t i = processor->running;
    if (i == NONE) return;
    Job *job = first_job(s, i);
    if (processor->executing) job->left -= now - processor->ready_at;
    note(s, now, processor->executing ? PREEMPTED : INTERRUPTED, i, job->number, 0);
    processor->running = NONE, processor->executing = 0;
}

static void resume(Scheduler *s, ProcessorState *processor, int64_t now) {
    int64_t i = processor->running;
    Job *job = first_job(s, i);
    processor->executing = 1, processor->ready_at = now;
    note(s, now, job->started ? RESUMED : STARTED, i, job->number, 0);
    if (job->started) return;
    job->started = 1, s->tasks[i].started_at = now;
    if (job->sample == NONE) sample(s, i, job, now);
}

static void dispatch(Scheduler *s, int64_t p, int64_t now) {
    ProcessorState *processor = &s->processors[p];
    int64_t cost = PROCESSOR(p, SWITCH), waits = 0, chosen = processor->running;
    processor->changed = 0;
    if (chosen == NONE || PROCESSOR(p, PREEMPTIVE))
        EACH(i, TASKS) {
            if (TASK(i, PROCESSOR) != p || i == processor->running || !s->tasks[i].jobs.count) continue;
            if (s->tasks[i].started_at == now && !cost && !first_job(s, i)->started) {
                waits = 1;
                continue;
            }
            if (chosen == NONE || precedes(s, PROCESSOR(p, POLICY), i, chosen)) chosen = i;
        }
    if (chosen != processor->running) {
        preempt(s, processor, now);
        processor->running = chosen, processor->ready_at = now + cost;
        if (cost) note(s, now, SWITCHING, chosen, first_job(s, chosen)->number, 0);
    }
    int64_t then = LATER;
    if (processor->running != NONE) {
        if (!processor->executing && processor->ready_at <= now) resume(s, processor, now);
        then = processor->ready_at + (processor->executing ? first_job(s, processor->running)->left : 0);
    }
    s->busy[p] = waits && now + 1 < then ? now + 1 : then;
}

/* -- an instant ---------------------------------------------------------------------------------------------------- */

static void end(Scheduler *s, int64_t now) {
    EACH(p, PROCESSORS) {
        ProcessorState *processor = &s->processors[p];
        if (s->busy[p] != now) continue;
        s->busy[p] = LATER, processor->changed = 1;
        if (processor->executing && processor->ready_at + first_job(s, processor->running)->left == now)
            finish(s, processor, now);
    }
    EACH(k, LINKS) {
        if (s->line[k] != now) continue;
        s->line[k] = LATER, s->links[k].changed = 1;
        end_frame(s, &s->links[k], now);
    }
}

static void meet_deadlines(Scheduler *s, int64_t now) {
    EACH(i, TASKS)
        if (s->deadline[i] == now && TASK(i, OVERRUN) == ABORT)
            while (s->tasks[i].jobs.count && first_job(s, i)->deadline <= now) abort_job(s, i, now);
    EACH(i, TASKS) {
        if (s->deadline[i] != now) continue;
        Queue *unwritten = &s->tasks[i].unwritten;
        while (unwritten->count && ((Job *)head(unwritten))->deadline <= now) {
            Job job = *(Job *)head(unwritten);
            drop(unwritten);
            write_outputs(s, i, &job, now);
        }
        set_deadline(s, i, now);
    }
}

static void arrive(Scheduler *s, int64_t now) {
    EACH(c, CARRIERS) {
        if (s->arrival[c] != now) continue;
        Queue *pending = &s->carriers[c].pending;
        while (pending->count && *(int64_t *)head(pending) == now) {
            drop(pending);
            for (int64_t r = CARRIER(c, RELEASES); r < CARRIER(c, RELEASES_END); r++)
                if (now < s->g.stop) release_job(s, s->g.releases[r], now, now);
        }
        s->arrival[c] = pending->count ? *(int64_t *)head(pending) : LATER;
    }
    EACH(i, TASKS) while (s->release[i] == now) {
        release_job(s, i, s->tasks[i].next_nominal, now);
        draw_release(s, i);
    }
    EACH(m, MESSAGES) while (s->instant[m] == now) {
        post(s, m, now);
        draw_instant(s, m);
    }
    EACH(j, LEGS) {
        if (s->hop[j] != now) continue;
        Queue *coming = &s->legs[j].coming;
        while (coming->count && ((Frame *)head(coming))->coming == now) {
            Frame frame = *(Frame *)head(coming);
            drop(coming);
            queue_frame(s, j, &frame, now);
        }
        s->hop[j] = coming->count ? ((Frame *)head(coming))->coming : LATER;
    }
    EACH(k, LINKS) {
        if (s->slot[k] != now) continue;
        s->links[k].slot = s->links[k].slots_past++ % LINK(k, SLOTS), s->links[k].changed = 1;
        draw_slot(s, k);
    }
}

/* Processes an instant; returns a lower bound of the next one: what is due there may be postponed. */
static int64_t process_instant(Scheduler *s, int64_t now) {
    int64_t next;
    do {
        do {
            end(s, now);
            if (s->has_deadlines) meet_deadlines(s, now);
            arrive(s, now);
            if (s->no_memory) return now;
            next = least(s->due, s->due_count);
        } while (next == now);
        if (now == s->g.stop) return next;
        EACH(p, PROCESSORS) {
            if (!s->processors[p].changed) continue;
            dispatch(s, p, now);
            next = s->busy[p] < next ? s->busy[p] : next;
        }
    } while (next == now);
    EACH(k, LINKS) {
        if (!s->links[k].changed) continue;
        choose_frame(s, k, now);
        next = s->line[k] < next ? s->line[k] : next;
    }
    return next;
}

/* -- for Python ---------------------------------------------------------------------------------------------------- */

#define EXPORTED __attribute__((visibility("default")))

EXPORTED int64_t size_of_arguments(void) { return sizeof(Arguments); }

EXPORTED void scheduler_free(Scheduler *s) {
    if (!s) return;
    if (s->tasks) EACH(i, TASKS) free(s->tasks[i].jobs.items), free(s->tasks[i].unwritten.items);
    if (s->legs) EACH(j, LEGS) free(s->legs[j].frames.items), free(s->legs[j].coming.items);
    if (s->carriers) EACH(c, CARRIERS) free(s->carriers[c].pending.items);
    free(s->tasks), free(s->processors), free(s->legs), free(s->links), free(s->carriers), free(s->messages);
    free(s->due), free(s);
}

static void *zeros(Scheduler *s, int64_t count, size_t size) {
    void *found = calloc((size_t)(count ? count : 1), size);
    if (!found) s->no_memory = 1;
    return found;
}

/* NULL without memory. */
EXPORTED Scheduler *scheduler_new(const Arguments *arguments) {
    Scheduler *s = calloc(1, sizeof(Scheduler));
    if (!s) return NULL;
    s->g = *arguments, s->queue_overflow = NONE;
    const int64_t *n = s->g.counts;
    s->due_count = n[PROCESSORS] + 2 * n[LINKS] + 2 * n[TASKS] + n[CARRIERS] + n[MESSAGES] + n[LEGS];
    s->tasks = zeros(s, n[TASKS], sizeof(TaskState)), s->processors = zeros(s, n[PROCESSORS], sizeof(ProcessorState));
    s->legs = zeros(s, n[LEGS], sizeof(LegState)), s->links = zeros(s, n[LINKS], sizeof(LinkState));
    s->carriers = zeros(s, n[CARRIERS], sizeof(CarrierState));
    s->messages = zeros(s, n[MESSAGES], sizeof(MessageState)), s->due = zeros(s, s->due_count, sizeof(int64_t));
    if (s->no_memory) {
        scheduler_free(s);
        return NULL;
    }
    for (int64_t i = 0; i < s->due_count; i++) s->due[i] = LATER;
    s->busy = s->due, s->line = s->busy + n[PROCESSORS], s->deadline = s->line + n[LINKS];
    s->arrival = s->deadline + n[TASKS], s->release = s->arrival + n[CARRIERS], s->instant = s->release + n[TASKS];
    s->hop = s->instant + n[MESSAGES], s->slot = s->hop + n[LEGS];
    EACH(i, TASKS) {
        s->tasks[i].jobs.size = s->tasks[i].unwritten.size = sizeof(Job);
        s->tasks[i].started_at = s->tasks[i].sampled_at = NONE;
        if (TASK(i, NOMINAL) != NONE) draw_release(s, i);
        if (TASK(i, WRITES_AT_DEADLINE) || TASK(i, OVERRUN) == ABORT) s->has_deadlines = 1;
    }
    EACH(p, PROCESSORS) s->processors[p].running = NONE;
    EACH(j, LEGS) {
        s->legs[j].frames.size = s->legs[j].coming.size = sizeof(Frame);
        if (LEG(j, PLACE) == 0) s->messages[LEG(j, MESSAGE)].first_leg = j;
    }
    EACH(c, CARRIERS) s->carriers[c].pending.size = sizeof(int64_t);
    EACH(m, MESSAGES) if (MESSAGE(m, NOMINAL) != NONE) draw_instant(s, m);
    EACH(k, LINKS) {
        s->links[k].sending = s->links[k].slot = NONE;
        if (LINK(k, SLOTS)) draw_slot(s, k);
    }
    return s;
}

EXPORTED int64_t scheduler_next_instant(Scheduler *s) {
    int64_t due = least(s->due, s->due_count);
    return due <= s->g.stop ? due : LATER;
}

/* Processes all instants before a time, up to the end; returns the number of notes left, -1 without memory, and less
   where too many wait. */
EXPORTED int64_t scheduler_run(Scheduler *s, int64_t until) {
    int64_t last = until - 1 < s->g.stop ? until - 1 : s->g.stop, now = least(s->due, s->due_count);
    while (now <= last && !s->no_memory) now = process_instant(s, now);
    int64_t note_count = s->g.note_count;
    s->g.note_count = 0;
    return s->queue_overflow != NONE ? -2 - s->queue_overflow : s->no_memory ? -1 : note_count;
}
