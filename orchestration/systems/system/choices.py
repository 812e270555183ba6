"""The values of keys that have a few words as values; the command line lists them without loading any record."""

from typing import Literal

Order = Literal["gauss-seidel", "jacobi"]
Hold = Literal["zero", "first"]
Clock = Literal["master", "fmu"]
Spread = Literal["uniform", "normal"]
TraceOrder = Literal["drawn", "as recorded"]
Align = Literal["exact", "next"]
Interpolation = Literal["linear", "previous", "spline"]
Outside = Literal["held"]
Scheduling = Literal["fixed-priority", "earliest-deadline-first", "first-come-first-served"]
Read = Literal["start", "release"]
Write = Literal["end", "deadline"]
Overrun = Literal["queue", "skip", "abort"]
NetworkKind = Literal["can", "can-fd", "tdma", "ethernet", "first-come-first-served"]
Stuffing = Literal["longest", "none"]
