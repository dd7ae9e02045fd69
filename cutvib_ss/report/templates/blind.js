"use strict";
(() => {
  const spread = (rows, colour) => ({
    type: "data", symmetric: false, color: colour, thickness: 1.2, width: 0,
    array: rows.map((r) => r.high - (r.right === undefined || typeof r.right === "boolean" ? r.stated : r.right)),
    arrayminus: rows.map((r) => (r.right === undefined || typeof r.right === "boolean" ? r.stated : r.right) - r.low),
  });
  const diagonal = (from, to) => ({ x: [from, to], y: [from, to], mode: "lines", line: { color: css("--soft"), dash: "dash", width: 1 }, hoverinfo: "skip", name: "stated = true" });

  function reliability() {
    const b = data.bins;
    draw("reliability", [
      diagonal(0, 1),
      { x: b.map((r) => r.at), y: b.map((r) => r.right), customdata: b.map((r) => r.cases), mode: "markers", name: "right, with 95 % interval",
        marker: { color: css("--corrected"), size: 8 }, error_y: spread(b, css("--corrected")), hovertemplate: "stated %{x:.2f}, right %{y:.2f} of %{customdata}<extra></extra>" },
      { type: "bar", x: data.counts.map((r) => r.at), y: data.counts.map((r) => r.cases), width: data.counts.map((r) => 0.9 * r.width), yaxis: "y2", name: "answers",
        showlegend: false, marker: { color: css("--measured") }, hovertemplate: "%{y} answers<extra></extra>" },
    ], layout(420, { hovermode: "closest", xaxis: axis("stated probability of the first answer", { range: [0, 1], anchor: "y2" }),
      yaxis: axis("right", { range: [-0.02, 1.02], domain: [0.32, 1] }), yaxis2: axis("answers", { domain: [0, 0.22] }) }));
  }

  function risk() {
    const r = data.risk;
    draw("risk", [{ x: r.coverage, y: r.risk, mode: "lines", line: { shape: "vh", color: css("--corrected"), width: 1.6 }, hovertemplate: "%{x:.2f} counted, %{y:.3f} wrong<extra></extra>" }],
      layout(420, { hovermode: "closest", showlegend: false, xaxis: axis("answers counted, the surest first", { range: [0, 1] }),
        yaxis: axis("wrong among them", { range: [0, Math.max(0.05, 1.15 * Math.max(0, ...r.risk))] }) }));
  }

  function severity() {
    const g = data.severity, x = g.map((r) => `${r.name}<br>${r.cases} cases`);
    draw("severity", [
      { type: "bar", x, y: g.map((r) => r.right), name: "right first", marker: { color: clear(css("--corrected"), 0.75) }, error_y: spread(g, css("--ink")), hovertemplate: "%{y:.2f} right<extra></extra>" },
      { x, y: g.map((r) => r.probability), mode: "markers", name: "mean probability on the truth", marker: { symbol: "diamond", size: 9, color: css("--tuned") }, hovertemplate: "%{y:.2f}<extra></extra>" },
    ], layout(420, { hovermode: "closest", xaxis: axis(""), yaxis: axis("", { range: [0, 1.02] }) }));
  }

  function shrinkage() {
    const least = 1e-3, cut = (v) => Math.max(v, least);
    const traces = [diagonal(least, 2)];
    traces[0].showlegend = false;
    for (const [right, paint, name] of [[true, "--corrected", "right first"], [false, "--nominal", "wrong"]]) {
      const s = data.shrinkage.filter((r) => r.right === right && r.stated !== null && r.achieved !== null).map((r) => ({ ...r, stated: cut(r.stated), low: cut(r.low ?? r.stated), high: cut(r.high ?? r.stated), achieved: cut(r.achieved) }));
      traces.push({ x: s.map((r) => r.achieved), y: s.map((r) => r.stated), text: s.map((r) => r.name), mode: "markers", name, marker: { color: css(paint), size: 6 },
        error_y: spread(s, clear(css(paint), 0.4)), hovertemplate: "%{text}: stated %{y:.3g}, on fresh records %{x:.3g}<extra></extra>" });
    }
    const more = { type: "log", range: [Math.log10(least / 1.5), Math.log10(2)], exponentformat: "power", dtick: 1 };
    draw("shrinkage", traces, layout(420, { hovermode: "closest", xaxis: axis("left on fresh records", more), yaxis: axis("left, as stated", more) }));
  }

  function confusion(id) {
    const m = data.maps[id], total = m.counts.map((row) => Math.max(1, row.reduce((a, b) => a + b, 0)));
    const share = m.counts.map((row, k) => row.map((v) => v / total[k]));
    const right = [];
    m.truths.forEach((truth, r) => {
      const c = m.named.indexOf(truth.startsWith("outside:") ? "unknown" : truth);
      if (c >= 0) right.push({ type: "rect", x0: c - 0.5, x1: c + 0.5, y0: r - 0.5, y1: r + 0.5, line: { color: css("--ink"), width: 1.2 } });
    });
    const room = narrow() ? { l: 120, r: 8, t: 34, b: 150 } : { l: 210, r: 12, t: 34, b: 170 };
    draw(id, [{
      type: "heatmap", x: m.named, y: m.truths, z: share, text: m.counts.map((row) => row.map((v) => (v ? String(v) : ""))), texttemplate: narrow() ? "" : "%{text}", zmin: 0, zmax: 1,
      colorscale: [[0, css("--paper")], [1, css("--corrected")]], showscale: false, customdata: m.counts, hovertemplate: "%{y} named %{x}: %{customdata}<extra></extra>",
    }], layout(240 + 19 * m.truths.length, { hovermode: "closest", margin: room, shapes: right,
      xaxis: axis("named first", { tickangle: 90, type: "category" }), yaxis: axis("", { autorange: "reversed", type: "category", tickfont: { size: narrow() ? 9 : 12 } }) }));
  }

  function campaigns() {
    const c = data.campaigns;
    draw("campaigns", [{
      type: "bar", orientation: "h", y: c.map((r) => r.name), x: c.map((r) => r.probability), text: c.map((r) => (r.rank === null ? "not listed" : `rank ${r.rank}`)), textposition: "outside", cliponaxis: false,
      marker: { color: c.map((r) => css(r.rank === 1 ? "--corrected" : "--nominal")) }, hovertemplate: "%{y}: %{x:.3f}<extra></extra>",
    }], layout(90 + 28 * c.length, { hovermode: "closest", showlegend: false, xaxis: axis("probability", { range: [0, 1.15], tickvals: [0, 0.25, 0.5, 0.75, 1] }), yaxis: axis("", { autorange: "reversed", type: "category" }) }));
  }

  function all() {
    if ($("campaigns")) return campaigns();
    reliability();
    risk();
    severity();
    if ($("shrinkage")) shrinkage();
    confusion("causes");
    confusion("places");
  }
  keepDrawn(all);
})();
