"""
Where do a machine and its model differ, and why? A diagnosis of the campaign that ships with the package.

    python examples/diagnose_a_campaign.py
"""

from pathlib import Path

import cutvib_ss as cv
from cutvib_ss.report import verdict_sentence, write_report

campaign = cv.read_campaign(Path(cv.__file__).parent / "data" / "demo")
diagnosis = cv.diagnose(campaign)

print(verdict_sentence(diagnosis))
for cause in diagnosis.causes[:3]:
    print(f"  {cause.probability:6.1%}  {cause.effect} at {cause.place}")
    for name, parameter in cause.parameters.items():
        print(f"          {name} = {parameter.value:.4g} ± {parameter.std:.2g} {parameter.unit}")

cv.plot.save(cv.plot.error_map(diagnosis.comparisons), "error_of_the_tuned_model.png")
cv.plot.save(cv.plot.comparison_grid(diagnosis.comparisons[:3]), "responses.png")
write_report(diagnosis, "report.html")
print("written: report.html")
