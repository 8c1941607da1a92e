"use strict";
// Tracks and time histories that move together. The data are described in linked.py.

const LINKED_COLOURS = 8;
const LINKED_DASHES = ["solid", "7px,3px", "2px,2px", "8px,2px,2px,2px"];

function linkedPlots(root) {
  const data = JSON.parse(root.querySelector('script[type="application/json"]').textContent);
  const scope = root.closest("section") ?? document.body;
  const boxes = [...scope.querySelectorAll("input[data-toggle]")];
  const select = root.querySelector("select[data-runs]");
  const trackBox = root.querySelector("[data-track]");
  const historyBox = root.querySelector("[data-histories]");
  const off = new Set(); // roles switched off
  const escaped = (text) => text.replaceAll("&", "&amp;").replaceAll("<", "&lt;").replaceAll(">", "&gt;");
  const short = (name) => (name.includes("/") ? name.split("/").pop() : name);
  const column = Object.fromEntries(data.columns.map((c, i) => [c.name, { ...c, i }]));
  const config = { responsive: true, displaylogo: false, doubleClick: false, modeBarButtons: [["zoom2d", "pan2d", "zoomIn2d", "zoomOut2d"]] };
  let run, range = null, quiet = false;

  const unpacked = (steps, decimals) => {
    let sum = 0;
    return steps && steps.map((step) => (step === null ? null : (sum += step) / 10 ** decimals));
  };
  const lines = (source) => source && source.map((line) => line && line.map((steps, c) => unpacked(steps, data.columns[c].decimals)));
  const read = (source) => ({ ...source, t: unpacked(source.t, 2), values: lines(source.values), bands: lines(source.bands) });
  const css = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();
  const stroke = (role) => (role === "measured"
    ? { color: css("--ink"), width: 4 }
    : { color: css(`--c${role % LINKED_COLOURS}`), width: 2, dash: LINKED_DASHES[(role + Math.floor(role / LINKED_COLOURS)) % LINKED_DASHES.length] });
  const banded = () => data.series.filter((series, s) => run.bands?.[s]?.some((half) => half) && !off.has(series.role));
  const shown = (role) => { // a band stands alone: several would hide one another
    if (role.band !== undefined) return banded().length === 1 && !off.has(role.band);
    return off.has(role) ? "legendonly" : true;
  };
  const band = (role) => ({
    mode: "lines", fill: "toself", fillcolor: `${css(`--c${role % LINKED_COLOURS}`)}2e`, line: { width: 0 }, meta: { band: role }, visible: shown({ band: role }), hoverinfo: "skip", showlegend: false,
  });
  const within = (t) => range === null || (t >= range[0] && t <= range[1]);
  const base = () => ({
    paper_bgcolor: css("--paper"), plot_bgcolor: css("--paper"), font: { color: css("--ink"), family: "system-ui, sans-serif", size: 12 },
    hoverlabel: { bgcolor: css("--paper"), bordercolor: css("--line"), font: { color: css("--ink"), size: 12 }, namelength: 28 },
    modebar: { bgcolor: "rgba(0,0,0,0)", color: css("--dim"), activecolor: css("--accent") },
  });
  const axis = () => ({ gridcolor: css("--grid"), zeroline: false, linecolor: css("--line"), automargin: true });

  const drawTrack = () => {
    if (data.track === null) return;
    const [east, north] = data.track.map((name) => column[name]);
    const traces = run.outlines.map(([x, y]) => ({
      x, y, mode: "lines", fill: "toself", fillcolor: css("--hull"), line: { color: css("--dim"), width: 0.7 }, hoverinfo: "skip", showlegend: false,
    }));
    data.series.forEach((series, s) => {
      const line = run.values[s];
      if (!line || !line.some((values) => values)) return;
      const wide = run.bands?.[s];
      if (wide?.[east.i] && wide[north.i]) { // rectangles at the quarters of the run
        const last = run.t.length - 1;
        const at = [1, 2, 3, 4].map((q) => Math.round((q * last) / 4)).filter((k) => within(run.t[k]) && line[east.i][k] !== null);
        const corners = (centre, half, signs) => at.flatMap((k) => [...signs.map((sign) => centre[k] + sign * half[k]), null]);
        traces.push({
          ...band(series.role), x: corners(line[east.i], wide[east.i], [-1, 1, 1, -1, -1]), y: corners(line[north.i], wide[north.i], [-1, -1, 1, 1, -1]),
        });
      }
      const onTrack = line[east.i] !== null; // a series of histories alone stands in the legend
      const keep = onTrack ? run.t.map((t, k) => k).filter((k) => within(run.t[k])) : [];
      traces.push({
        x: onTrack ? keep.map((k) => line[east.i][k]) : [null], y: onTrack ? keep.map((k) => line[north.i][k]) : [null], customdata: keep.map((k) => run.t[k]),
        name: escaped(short(series.name)), meta: series.role, mode: "lines", line: stroke(series.role), visible: shown(series.role),
        opacity: series.role === "measured" ? 0.5 : 1,
        hovertemplate: `%{customdata:.1f} s<br>${east.label} %{x:.1f} m<br>${north.label} %{y:.1f} m<extra>%{fullData.name}</extra>`,
      });
    });
    traces.push({ x: [], y: [], mode: "markers", marker: { size: 10, line: { width: 1.5, color: css("--paper") }, color: [] }, meta: "cursor", hoverinfo: "skip", showlegend: false });
    const layout = {
      ...base(), margin: { l: 60, r: 10, t: 28, b: 75 }, hovermode: "closest", dragmode: "zoom", showlegend: true,
      legend: { orientation: "h", yref: "container", y: 0, yanchor: "bottom", font: { size: 12 } },
      xaxis: { ...axis(), title: { text: `${east.label} [m]` } },
      yaxis: { ...axis(), title: { text: `${north.label} [m]` }, scaleanchor: "x", scaleratio: 1 },
    };
    quiet = true;
    Plotly.react(trackBox, traces, layout, config).then(() => { quiet = false; });
  };

  const drawHistories = () => {
    const count = data.histories.length;
    const gap = 0.22 / count;
    const layout = {
      ...base(), margin: { l: 62, r: 10, t: 28, b: 45 }, height: 60 + 118 * count, hovermode: "x unified", hoverdistance: 30, dragmode: "zoom", showlegend: false,
      xaxis: {
        ...axis(), title: { text: "time after the start [s]" }, anchor: count === 1 ? "y" : `y${count}`, showspikes: true, spikemode: "across", spikethickness: 1, spikedash: "dot",
        spikecolor: css("--dim"), unifiedhovertitle: { text: "%{x:.1f} s" }, range: range ?? [run.t[0], run.t.at(-1)],
      },
      annotations: [],
    };
    const traces = [];
    data.histories.forEach((name, h) => {
      const quantity = column[name];
      const id = h === 0 ? "" : h + 1;
      const top = 1 - h / count;
      layout[`yaxis${id}`] = { ...axis(), domain: [Math.max(0, top - 1 / count + gap * 0.1), top - gap], anchor: "x", nticks: 5 };
      layout.annotations.push({
        text: `${quantity.label} [${quantity.unit}]`, xref: "paper", yref: "paper", x: 0, y: top - gap, xanchor: "left", yanchor: "bottom", showarrow: false, font: { size: 12 },
      });
      data.series.forEach((series, s) => {
        const line = run.values[s];
        if (!line || !line[quantity.i]) return;
        const half = run.bands?.[s]?.[quantity.i];
        if (half) {
          const keep = run.t.map((t, k) => k).filter((k) => line[quantity.i][k] !== null);
          const back = keep.toReversed();
          traces.push({
            ...band(series.role), x: [...keep, ...back].map((k) => run.t[k]), xaxis: "x", yaxis: `y${id}`,
            y: [...keep.map((k) => line[quantity.i][k] + half[k]), ...back.map((k) => line[quantity.i][k] - half[k])],
          });
        }
        traces.push({
          x: run.t, y: line[quantity.i], xaxis: "x", yaxis: `y${id}`, name: escaped(short(series.name)), meta: series.role, mode: "lines", line: stroke(series.role),
          visible: shown(series.role), opacity: series.role === "measured" ? 0.5 : 1, hovertemplate: `%{y:.${quantity.decimals}f} ${quantity.unit}`,
        });
      });
    });
    quiet = true;
    Plotly.react(historyBox, traces, layout, config).then(() => { quiet = false; });
  };

  const cursor = (time) => {
    if (data.track !== null) {
      const [east, north] = data.track.map((name) => column[name].i);
      const at = { x: [], y: [], color: [] };
      if (time !== null) {
        const k = run.t.reduce((best, t, i) => (Math.abs(t - time) < Math.abs(run.t[best] - time) ? i : best), 0);
        data.series.forEach((series, s) => {
          const line = run.values[s];
          if (!line || !line[east] || off.has(series.role) || line[east][k] === null) return;
          at.x.push(line[east][k]);
          at.y.push(line[north][k]);
          at.color.push(stroke(series.role).color);
        });
      }
      Plotly.restyle(trackBox, { x: [at.x], y: [at.y], "marker.color": [at.color] }, [trackBox.data.length - 1]);
    }
  };
  const timeLine = (time) => {
    const line = { type: "line", xref: "x", yref: "paper", x0: time, x1: time, y0: 0, y1: 1, line: { color: css("--dim"), width: 1, dash: "dot" } };
    Plotly.relayout(historyBox, { shapes: time === null ? [] : [line] });
  };

  const show = () => {
    for (const box of boxes) {
      for (const part of scope.querySelectorAll(`[data-m="${box.dataset.toggle}"]`)) part.toggleAttribute("hidden", !box.checked);
      const role = Number(box.dataset.toggle);
      if (box.checked) off.delete(role); else off.add(role);
    }
    for (const box of [trackBox, historyBox]) {
      if (!box.data) continue;
      const mine = box.data.map((trace, i) => i).filter((i) => box.data[i].meta !== undefined && box.data[i].meta !== "cursor");
      Plotly.restyle(box, { visible: mine.map((i) => shown(box.data[i].meta)) }, mine);
    }
  };
  const toggle = (role) => {
    const box = boxes.find((other) => Number(other.dataset.toggle) === role);
    if (box) box.checked = !box.checked;
    else if (off.has(role)) off.delete(role);
    else off.add(role);
    show();
  };
  const redraw = () => { drawTrack(); drawHistories(); };
  const reset = () => { range = null; redraw(); };
  const choose = () => {
    run = read(data.runs[select.value]);
    range = null;
    root.querySelector("[data-run]").textContent = run.name;
    run.cells.forEach((texts, model) => texts.forEach((text, i) => {
      const cell = scope.querySelector(`[data-cell="${model}-${i}"]`);
      if (cell) cell.textContent = text;
    }));
    redraw();
  };

  boxes.forEach((box) => box.addEventListener("change", show));
  for (const button of scope.querySelectorAll("button[data-all]")) {
    button.addEventListener("click", () => {
      boxes.forEach((box) => { box.checked = button.dataset.all === "1"; });
      show();
    });
  }
  select.addEventListener("change", choose);
  for (const button of root.querySelectorAll("button[data-step]")) {
    button.addEventListener("click", () => {
      select.selectedIndex = (select.selectedIndex + Number(button.dataset.step) + data.runs.length) % data.runs.length;
      choose();
    });
  }
  root.querySelector("button[data-reset]").addEventListener("click", reset);
  if (!(Number(select.value) >= 0)) select.value = String(data.start); // a browser may keep the choice over a reload
  choose();
  show();
  for (const box of data.track === null ? [historyBox] : [trackBox, historyBox]) {
    box.on("plotly_legendclick", (event) => { toggle(event.data[event.curveNumber].meta); return false; });
    box.on("plotly_legenddoubleclick", () => false);
    box.on("plotly_doubleclick", reset);
  }
  historyBox.on("plotly_hover", (event) => cursor(event.xvals?.[0] ?? event.points[0].x));
  historyBox.on("plotly_unhover", () => cursor(null));
  historyBox.on("plotly_relayout", (change) => {
    if (quiet || change["xaxis.range[0]"] === undefined) return;
    range = [change["xaxis.range[0]"], change["xaxis.range[1]"]];
    drawTrack();
  });
  if (data.track !== null) {
    trackBox.on("plotly_hover", (event) => timeLine(event.points[0].customdata));
    trackBox.on("plotly_unhover", () => timeLine(null));
  } else trackBox.parentElement.hidden = true;
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", redraw);
}

document.querySelectorAll("[data-linked]").forEach(linkedPlots);
