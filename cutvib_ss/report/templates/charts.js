"use strict";
(() => {
  const LABEL = { measured: "measured", nominal: "nominal model", tuned: "re-tuned model", corrected: "corrected model" };
  const DASH = { nominal: "dash", tuned: "dot", corrected: "solid" };

  function responses() {
    told("frf-shown", $("frf-record"), $("frf-channel"));
    const record = data.records[$("frf-record").value];
    const channel = record.channels.find((c) => c.name === $("frf-channel").value) || record.channels[0];
    const x = record.freq, traces = [], measured = modulus(channel.measured), noise = channel.noise;
    const group = (name) => ({ legendgroup: name, name: LABEL[name] || name });
    const line = (name, y, yaxis, shown, width) => traces.push({
      x, y, yaxis, mode: "lines", ...group(name), showlegend: shown, line: { color: css(`--${name}`), dash: DASH[name], width },
      hovertemplate: `%{y:.4g}<extra>${LABEL[name]}</extra>`,
    });
    traces.push(band(x, measured.map((v, k) => Math.max(v - 2 * noise[k], 1e-12)), measured.map((v, k) => v + 2 * noise[k]), css("--measured"),
      "noise, ± 2 standard deviations", { legendgroup: "noise" }));
    const corrected = modulus(channel.corrected);
    if (data.repeatability) {
      traces.push(band(x, corrected.map((v) => v * Math.max(1 - 2 * data.repeatability, 1e-6)), corrected.map((v) => v * (1 + 2 * data.repeatability)),
        css("--corrected"), "repeatability, ± 2", { legendgroup: "repeatability" }));
    }
    line("measured", measured, "y", true, 2.2);
    line("measured", phase(channel.measured), "y2", false, 1.8);
    const differences = [];
    for (const side of ["nominal", "tuned", "corrected"]) {
      line(side, modulus(channel[side]), "y", true, 1.5);
      line(side, phase(channel[side]), "y2", false, 1.3);
      const d = apart(channel[side], channel.measured);
      differences.push(...d);
      line(side, d, "y3", false, 1.3);
    }
    traces.push({ x, y: noise, yaxis: "y3", mode: "lines", name: "noise", legendgroup: "noise", showlegend: false, line: { color: css("--ink"), dash: "dot", width: 1.2 } });
    if (data.repeatability) {
      traces.push({ x, y: corrected.map((v, k) => Math.hypot(noise[k], data.repeatability * v)), yaxis: "y3", mode: "lines", name: "noise and repeatability",
        legendgroup: "repeatability", showlegend: false, line: { color: css("--soft"), dash: "dashdot", width: 1.2 } });
    }
    const coherent = channel.coherence !== null;
    if (coherent) traces.push({ x, y: channel.coherence, yaxis: "y4", mode: "lines", name: "coherence", showlegend: false, line: { color: css("--measured"), width: 1.4 } });
    const ends = coherent ? [[0.6, 1], [0.42, 0.56], [0.14, 0.38], [0, 0.1]] : [[0.55, 1], [0.34, 0.5], [0, 0.29]];
    const unit = `[${channel.unit}]`;
    const named = Object.fromEntries([
      ["yaxis", axis(`modulus ${unit}`, { type: "log", exponentformat: "power", dtick: 1, domain: ends[0], range: decades(measured.concat(corrected, modulus(channel.nominal))) })],
      ["yaxis2", axis("phase [°]", { domain: ends[1], range: [-110, 270], tickvals: [-90, 0, 90, 180] })],
      ["yaxis3", axis(`difference ${unit}`, { type: "log", exponentformat: "power", dtick: 1, domain: ends[2], range: decades(differences) })],
      ...(coherent ? [["yaxis4", axis("coh.", { domain: ends[3], range: [0, 1.05], tickvals: [0, 1] })]] : []),
    ]);
    const bottom = coherent ? "y4" : "y3";
    const mark = marked(data.mark, x[0], x[x.length - 1]);
    const shapes = data.bands.map(([x0, x1]) => ({ type: "rect", xref: "x", yref: "paper", x0, x1, y0: 0, y1: 1, fillcolor: css("--soft"), opacity: 0.07, line: { width: 0 }, layer: "below" })).concat(mark.shapes || []);
    draw("frf", traces, layout(coherent ? 760 : 680, { ...named, xaxis: axis("frequency [Hz]", { anchor: bottom, range: [x[0], x[x.length - 1]] }), ...mark, shapes }));
  }

  function map() {
    told("map-shown", $("map-model"), $("map-channel"));
    const m = data.maps, side = $("map-model").value, channel = $("map-channel").value;
    const z = m.ratio[side][channel];
    const log = z.map((row) => row.map((v) => (v === null ? null : Math.log10(Math.min(Math.max(v, 1), 100)))));
    draw("map", [{
      type: "heatmap", x: m.freq, y: m.rows, z: log, customdata: z, zmin: 0, zmax: 2,
      colorscale: [[0, css("--paper")], [0.15, css("--heat1")], [0.5, css("--heat2")], [1, css("--heat3")]],
      colorbar: { ...(narrow() ? { orientation: "h", y: -0.32, yanchor: "top" } : {}), tickvals: [0, 0.5, 1, 1.5, 2], ticktext: ["1", "3", "10", "30", "100"], title: { text: "error / noise", side: narrow() ? "bottom" : "right" }, thickness: 12, outlinewidth: 0 },
      hovertemplate: "%{x:.4g} Hz, %{y}: %{customdata:.3g} times the noise<extra></extra>",
    }], layout((narrow() ? 190 : 130) + 34 * m.rows.length, { margin: { l: 58, r: 12, t: 34, b: 44 }, hovermode: "closest", ...marked(data.mark, m.freq[0], m.freq[m.freq.length - 1], true), xaxis: axis("frequency [Hz]"), yaxis: axis("", { autorange: "reversed", type: "category" }) }));
  }

  function stiffness(k) {
    const s = data.stiffness[k], traces = [], colours = ["--corrected", "--tuned", "--nominal", "--measured"];
    for (const [part, key, yaxis] of [["real", "re", "y"], ["imag", "im", "y2"]]) {
      s.levels.forEach((level, j) => {
        const colour = css(colours[Math.min(j, colours.length - 1)]), y = level[key];
        const lim = s.limits[part], cut = (v) => Math.min(Math.max(v, 3 * lim[0] - 2 * lim[1]), 3 * lim[1] - 2 * lim[0]);
        traces.push(band(s.freq, y.map((v, i) => cut(v - level.std[i])), y.map((v, i) => cut(v + level.std[i])), colour, "± 1 standard deviation", { yaxis, fillcolor: clear(colour, Math.max(0.25 / s.levels.length, 0.06)), legendgroup: `b${j}`, showlegend: part === "real" && j === 0 }));
        traces.push({ x: s.freq, y, yaxis, mode: "markers", marker: { color: colour, size: 3 }, name: level.name, legendgroup: `l${j}`, showlegend: part === "real", hovertemplate: "%{y:.4g}<extra>" + level.name + "</extra>" });
      });
      s.laws.forEach((law, j) => traces.push({ x: s.freq, y: law[key], yaxis, mode: "lines", line: { color: css(j ? "--ink" : "--nominal"), width: 1.8, dash: j ? "dash" : "solid" }, name: law.name, legendgroup: `w${j}`, showlegend: part === "real" }));
    }
    const unit = s.unit ? ` [${s.unit}]` : "";
    draw(`stiffness-${k}`, traces, layout(460, {
      xaxis: axis("frequency [Hz]", { anchor: "y2", range: [s.freq[0], s.freq[s.freq.length - 1]] }),
      yaxis: axis(`real part${unit}`, { domain: [0.54, 1], range: s.limits.real, exponentformat: "power" }),
      yaxis2: axis(`imaginary part${unit}`, { domain: [0, 0.46], range: s.limits.imag, exponentformat: "power" }),
    }));
  }

  function restoring(k) {
    const r = data.restoring[k];
    draw(`restoring-${k}`, [
      { x: r.q, y: r.alone, mode: "lines", name: "spring of the model", line: { color: css("--nominal"), dash: "dash", width: 1.5 }, hovertemplate: "%{x:.3g}: %{y:.4g}<extra>spring of the model</extra>" },
      { x: r.q, y: r.with, mode: "lines", name: "with the named restoring force", line: { color: css("--corrected"), width: 2 }, hovertemplate: "%{x:.3g}: %{y:.4g}<extra>with the named restoring force</extra>" },
    ], layout(360, { hovermode: "closest", xaxis: axis(r.x, { exponentformat: "power" }), yaxis: axis(r.y, { exponentformat: "power" }) }));
  }

  function all() {
    if (data.records.length) { responses(); map(); }
    data.stiffness.forEach((_, k) => stiffness(k));
    data.restoring.forEach((_, k) => restoring(k));
  }
  for (const id of ["frf-record", "frf-channel"]) if ($(id)) $(id).addEventListener("change", responses);
  for (const id of ["map-model", "map-channel"]) if ($(id)) $(id).addEventListener("change", map);
  if (data.records.length) {
    const [record, channel] = data.first;
    $("frf-record").value = record;
    if (channel) $("frf-channel").value = $("map-channel").value = channel;
  }
  keepDrawn(all);
})();
