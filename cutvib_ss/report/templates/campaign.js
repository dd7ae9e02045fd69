"use strict";
(() => {
  const colour = (k) => css(`--c${k % 6}`);
  const span = (values) => decades(values.filter((v) => v !== null && isFinite(v)));

  function responses(id, group, name) {
    const traces = [], moduli = [];
    let unit = "", coherent = false;
    group.records.forEach((record, k) => {
      const c = record.channels[name];
      if (!c) return;
      const m = modulus(c.h), label = record.level ? `${record.name} (${record.level})` : record.name;
      unit = c.unit;
      moduli.push(...m);
      const common = { x: c.freq, mode: "lines", name: label, legendgroup: `r${k}`, line: { color: colour(k), width: 1.4 } };
      traces.push(band(c.freq, m.map((v, i) => Math.max(v - 2 * c.noise[i], 1e-12)), m.map((v, i) => v + 2 * c.noise[i]), colour(k), label,
        { legendgroup: `r${k}`, showlegend: false }));
      traces.push({ ...common, y: m, hovertemplate: `%{y:.4g}<extra>${record.name}</extra>` });
      traces.push({ ...common, y: phase(c.h), yaxis: "y2", showlegend: false, hovertemplate: `%{y:.0f}°<extra>${record.name}</extra>` });
      if (c.coherence) {
        coherent = true;
        traces.push({ ...common, y: c.coherence, yaxis: "y3", showlegend: false, line: { color: colour(k), width: 1 }, hovertemplate: `%{y:.3f}<extra>coherence</extra>` });
      }
    });
    const model = group.nominal[name];
    if (model) {
      const line = { color: css("--ink"), dash: "dash", width: 1.2 };
      const common = { x: model.freq, mode: "lines", name: "nominal model", legendgroup: "nominal", line };
      traces.push({ ...common, y: modulus(model.h), hovertemplate: "%{y:.4g}<extra>nominal model</extra>" });
      traces.push({ ...common, y: phase(model.h), yaxis: "y2", showlegend: false, hovertemplate: "%{y:.0f}°<extra>nominal model</extra>" });
    }
    const ends = coherent ? [[0.42, 1], [0.2, 0.37], [0, 0.15]] : [[0.36, 1], [0, 0.3]];
    const axes = {
      yaxis: axis(`modulus [${unit}]`, { type: "log", exponentformat: "power", dtick: 1, domain: ends[0], range: span(moduli) }),
      yaxis2: axis("phase [°]", { domain: ends[1], range: [-110, 270], tickvals: [-90, 0, 90, 180] }),
      ...(coherent ? { yaxis3: axis("coherence", { domain: ends[2], range: [0, 1.05], tickvals: [0, 0.5, 1] }) } : {}),
    };
    const [low, high] = group.band;
    const xaxis = axis("frequency [Hz]", { anchor: coherent ? "y3" : "y2", range: [low, high] });
    // Two to a sheet of paper.
    const height = document.documentElement.classList.contains("print") ? 450 : coherent ? 600 : 480;
    draw(id, traces, layout(height, { ...marked(data.mark, low, high), ...axes, xaxis }));
  }

  function poles() {
    told("poles-shown", $("poles-group"));
    const p = data.poles[$("poles-group").value], table = $("poles-table");
    table.textContent = "";
    if (p.why_not) {
      Plotly.purge("poles");
      widths.set("poles", $("poles").clientWidth);
      table.textContent = `No diagram of ${p.record}: ${p.why_not}`;
      return;
    }
    const kinds = [[2, "circle", "--corrected", "frequency and damping stay"], [1, "triangle-up", "--tuned", "frequency stays"], [0, "x-thin-open", "--soft", "new"]];
    const traces = [{ x: p.freq, y: p.modulus, yaxis: "y2", mode: "lines", name: "mean modulus", line: { color: css("--measured"), width: 1.2 }, hoverinfo: "skip" }];
    for (const [kind, symbol, paint, name] of kinds) {
      const at = p.stable.map((s, k) => (s === kind ? k : -1)).filter((k) => k >= 0);
      traces.push({
        x: at.map((k) => p.natural_freq[k]), y: at.map((k) => p.order[k]), customdata: at.map((k) => p.damping[k]), mode: "markers", name,
        marker: { symbol, color: css(paint), size: 6 }, hovertemplate: "%{x:.2f} Hz, damping %{customdata:.2f} %, order %{y}<extra></extra>",
      });
    }
    const low = p.freq[0], high = p.freq[p.freq.length - 1];
    draw("poles", traces, layout(380, {
      hovermode: "closest", ...marked(data.mark, low, high), xaxis: axis("frequency [Hz]", { range: [low, high] }),
      yaxis: axis("order of the model", { range: [0, 1.05 * Math.max(...p.order, 2)] }),
      yaxis2: { type: "log", overlaying: "y", visible: false, range: span(p.modulus) },
    }));
    const row = (cells, tag) => {
      const tr = document.createElement("tr");
      cells.forEach((text, k) => {
        const cell = document.createElement(tag);
        cell.textContent = text;
        if (k) cell.className = "n";
        tr.append(cell);
      });
      return tr;
    };
    const made = document.createElement("table");
    made.append(row(["natural frequency [Hz]", "damping ratio [%]", "stable at so many orders"], "th"), ...p.columns.map((c) => row(c, "td")));
    table.append(made);
  }

  function blows() {
    if (!$("blows")) return;
    told("blows-shown", $("blows-record"));
    const b = data.blows[$("blows-record").value], traces = [];
    b.force.forEach((f, k) => traces.push({ x: f.x, y: f.y, mode: "lines", name: `blow ${k + 1}`, legendgroup: `b${k}`, line: { color: colour(k), width: 1.4 }, hovertemplate: "%{y:.4g}<extra></extra>" }));
    b.response.forEach((r, k) => traces.push(band(r.x, r.low, r.high, colour(k), `blow ${k + 1}`, { xaxis: "x2", yaxis: "y2", legendgroup: `b${k}`, showlegend: false })));
    draw("blows", traces, layout(480, {
      xaxis: axis("time from the peak [ms]", { anchor: "y" }), yaxis: axis(`force [${b.unit}]`, { domain: [0.58, 1] }),
      xaxis2: axis("time [s]", { anchor: "y2" }), yaxis2: axis(b.channel, { domain: [0, 0.42] }),
    }));
  }

  // On paper nobody chooses: every position and channel, one under the other.
  function paper() {
    const all = $("frf-all");
    if (all.childElementCount) return;
    const channels = [...$("frf-channel").options].map((o) => o.value);
    data.groups.forEach((group, g) => channels.forEach((name) => {
      if (!group.records.some((r) => r.channels[name])) return;
      const title = document.createElement("h4"), chart = document.createElement("div");
      title.textContent = `${group.title}: ${name}`;
      chart.className = "chart";
      chart.id = `frf-${g}-${name}`;
      all.append(title, chart);
      responses(chart.id, group, name);
    }));
  }

  function all() {
    if (document.documentElement.classList.contains("print")) paper();
    else $("frf-all").textContent = "";
    responses("frf", data.groups[$("frf-group").value], $("frf-channel").value);
    poles();
    blows();
  }
  for (const id of ["frf-group", "frf-channel"]) $(id).addEventListener("change", () => responses("frf", data.groups[$("frf-group").value], $("frf-channel").value));
  $("poles-group").addEventListener("change", poles);
  if ($("blows")) $("blows-record").addEventListener("change", blows);
  keepDrawn(all);
})();
