"use strict";
// What all pages share: colours of the page, axes, and charts that are drawn anew where colours or widths change.
const bytes = (text) => Uint8Array.from(atob(text), (c) => c.charCodeAt(0));
// Arrays come packed: single precision in base64, NaN for no value.
const numbers = (packed) => Array.from(new Float32Array(bytes(packed).buffer), (v) => (isNaN(v) ? null : v));
const data = JSON.parse(document.getElementById("charts-data").textContent, (_, v) => (v && v.f4 !== undefined ? numbers(v.f4) : v));
const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
const $ = (id) => document.getElementById(id);
const config = { displaylogo: false, modeBarButtons: [["toImage", "zoom2d", "pan2d", "zoomIn2d", "zoomOut2d", "resetScale2d"]] };
// On paper the choices are not to be seen: what is drawn is named.
const told = (id, ...choices) => { $(id).textContent = choices.map((c) => c.selectedOptions[0].textContent).join(", "); };

const modulus = (z) => z.re.map((x, k) => (x === null ? null : Math.hypot(x, z.im[k])));
// From -100° on, so that neither 0° nor 180° lies at the end; broken where it jumps.
const phase = (z) => {
  const turned = z.re.map((x, k) => (x === null ? null : ((((180 / Math.PI) * Math.atan2(z.im[k], x) + 100) % 360) + 360) % 360 - 100));
  return turned.map((v, k) => (k && v !== null && Math.abs(v - turned[k - 1]) > 200 ? null : v));
};
const apart = (a, b) => a.re.map((x, k) => (x === null ? null : Math.hypot(x - b.re[k], a.im[k] - b.im[k])));
const clear = (colour, alpha) => {
  const n = parseInt(colour.slice(1), 16);
  return `rgba(${n >> 16},${(n >> 8) & 255},${n & 255},${alpha})`;
};
const decades = (values) => {
  const known = values.filter((v) => v > 0).sort((a, b) => a - b);
  return known.length ? [Math.log10(known[Math.floor(0.002 * known.length)]) - 0.1, Math.log10(known[known.length - 1]) + 0.1] : [-1, 1];
};
const band = (x, low, high, colour, name, extra) => ({
  x: x.concat([...x].reverse()), y: high.concat([...low].reverse()), fill: "toself", fillcolor: clear(colour, 0.25),
  line: { width: 0 }, mode: "lines", name, hoverinfo: "skip", ...extra,
});
const axis = (title, more) => ({
  title: { text: title, standoff: 4 }, gridcolor: css("--line"), zerolinecolor: css("--soft"), linecolor: css("--soft"), automargin: true, ...more,
});
const layout = (height, more) => ({
  height, paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: css("--ink"), size: 12, family: "Helvetica, Arial, sans-serif" },
  margin: { l: 58, r: 12, t: 34, b: 44 }, hovermode: "x", hoverlabel: { bgcolor: css("--paper"), bordercolor: css("--soft"), font: { color: css("--ink") } },
  legend: { orientation: "h", y: 1.02, yanchor: "bottom", x: 0 }, modebar: { color: css("--soft"), activecolor: css("--mark"), bgcolor: "rgba(0,0,0,0)", orientation: "h" },
  dragmode: matchMedia("(pointer: coarse)").matches ? false : "zoom", ...more,
});
const narrow = () => document.querySelector("main").clientWidth < 600;
const widths = new Map(), wasNarrow = new Map();
const draw = (id, traces, shape) => {
  const width = $(id).clientWidth;
  widths.set(id, width);
  if (width < 600) {
    // Names below: beside the buttons there is no room for them.
    const rows = new Set(traces.filter((t) => t.showlegend !== false && t.name).map((t) => t.name)).size;
    shape.margin = { l: 52, r: 8, t: 30, b: 50 + 20 * rows };
    shape.legend = { orientation: "h", y: 0, yref: "container", yanchor: "bottom", x: 0, entrywidth: 1, entrywidthmode: "fraction" };
    shape.height += 20 * rows;
  }
  // Plotly keeps the colour bar of before where a new one lies the other way.
  if (wasNarrow.has(id) && wasNarrow.get(id) !== narrow()) Plotly.purge(id);
  wasNarrow.set(id, narrow());
  Plotly.react(id, traces, { ...shape, width }, config);
};

// A line at the frequency of the tool's force, where the axis reaches it.
const marked = (mark, x0, x1, over) => mark === null || mark <= x0 || mark >= x1 ? {} : {
  shapes: [{ type: "line", xref: "x", yref: "paper", x0: mark, x1: mark, y0: 0, y1: 1, line: { color: css(over ? "--ink" : "--soft"), width: 1, dash: "dot" }, layer: over ? "above" : "below" }],
  annotations: [{ x: mark, xref: "x", y: over ? 1 : 0, yref: "paper", xanchor: over ? "center" : "left", yanchor: "bottom", text: `${mark} Hz`, showarrow: false, font: { size: 11, color: css("--soft") } }],
};
// The plotting library comes compressed.
const library = async () => {
  const script = document.createElement("script");
  const unpacked = new Blob([bytes(document.getElementById("plotly").textContent)]).stream().pipeThrough(new DecompressionStream("gzip"));
  script.textContent = await new Response(unpacked).text();
  document.head.append(script);
};
// Draw once the library is there, and again where colours or widths change: another scheme, a turned phone, a scroll bar, the paper.
const keepDrawn = (all) => {
  let redraw = () => {};
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw());
  addEventListener("message", (event) => {
    const theme = event.data && event.data.theme;
    if (event.origin !== location.origin || (theme !== "light" && theme !== "dark")) return;
    document.documentElement.dataset.theme = theme;
    redraw();
  });
  addEventListener("beforeprint", () => { document.documentElement.classList.add("print"); redraw(); });
  addEventListener("afterprint", () => { document.documentElement.classList.remove("print"); redraw(); });
  library().then(() => {
    redraw = all;
    all();
    const watch = new ResizeObserver((entries) => {
      if (entries.some((e) => Math.abs(e.contentRect.width - (widths.get(e.target.id) || 0)) > 1)) all();
    });
    document.querySelectorAll(".chart").forEach((chart) => watch.observe(chart));
  }).catch((error) => {
    const line = document.createElement("p");
    line.className = "warnings";
    line.textContent = `The charts cannot be drawn in this browser (${error.message}); one of 2023 or later is needed.`;
    document.querySelector("main").prepend(line);
  });
};
