"""
The paper: its tables beside computed values, and Figs. 15 to 20 as far as its printed values allow.

    python examples/paper.py
"""

import cutvib_ss as cv
from cutvib_ss.paper import paper_curves
from cutvib_ss.plot.paper import FIGURES

for name in ("6", "7"):
    for row in cv.paper_tables()[name]:
        print(f"Table {name}: {row['name']}: printed {row['printed']}, computed {row['computed']:.6g}. {row['note']}")

curves = paper_curves()
print(curves.absorber)
for name, figure in FIGURES.items():
    cv.plot.save(figure(curves), f"{name}.png")
