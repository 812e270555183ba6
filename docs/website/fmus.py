"""The pages of this project's FMUs: the documentation in their archives."""

import re
from html import unescape

from controller_fmu.cascaded.slave import CascadedController
from controller_fmu.geometric.slave import GeometricController
from controller_fmu.sliding_mode.slave import UnifiedController
from fmu_kit.bundle import Target
from fmu_kit.documentation import variable_tables
from fmu_kit.packaging import fragment_of
from fmu_kit.slave import Slave
from plant_fmu.slave import QuadrotorPlant

SLAVES: tuple[type[Slave], ...] = (QuadrotorPlant, UnifiedController, GeometricController, CascadedController)
VARIABLES = """\
## Variables

As the model description has them. Vectors are `.x .y .z`, quaternions `.x .y .z .w`. A row that names several variables
holds for each of them; several starts are theirs in order. A *fixed* parameter can be set until initialisation ends, a
*tunable* one between steps too.

"""


def page(slave: type[Slave]) -> str:
    """The Markdown of the page of an FMU; its links start at the folder of the slave's module."""
    fragment = fragment_of(Target.parse(f"{slave.__module__}:{slave.__name__}"))
    tables = "\n".join(variable_tables(slave.variables))
    return f"# {slave.__name__}\n\n{slave.description}.\n\n{_headed(fragment)}\n\n{VARIABLES}{_headed(tables)}\n"


def _headed(html: str) -> str:
    """HTML with headings and programs in Markdown, so that they are in the contents, and highlighted."""
    html = re.sub(r'<h2 id="([^"]+)">(.*?)</h2>', r"\n## \2 {#\1}\n", html)
    html = re.sub(r"<h3>(.*?)</h3>", r"\n### \1\n", html)
    return re.sub(
        r"<pre[^>]*>(.*?)</pre>", lambda found: f"\n```python\n{unescape(found[1])}\n```\n", html, flags=re.DOTALL
    )
