"use strict";
document.documentElement.classList.add("scripted");

// Tables: every column head becomes a button; the first click sorts upwards, the next one downwards; missing values stay last.
for (const table of document.querySelectorAll("table.sortable")) {
  const body = table.tBodies[0];
  const heads = [...table.tHead.rows[0].cells];
  heads.forEach((head, column) => {
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = head.textContent || "rank";
    head.replaceChildren(button);
    button.addEventListener("click", () => {
      const sense = head.getAttribute("aria-sort") === "ascending" ? -1 : 1;
      heads.forEach((other) => other.removeAttribute("aria-sort"));
      head.setAttribute("aria-sort", sense > 0 ? "ascending" : "descending");
      const rows = [...body.rows].map((row) => [row.cells[column].dataset.by, row]);
      const numeric = rows.every(([by]) => by === "" || Number.isFinite(Number(by)));
      rows.sort(([a], [b]) => {
        if (a === "" || b === "") return (a === "") - (b === "");
        return sense * (numeric ? Number(a) - Number(b) : a.localeCompare(b, "en", { numeric: true }));
      });
      body.append(...rows.map(([, row]) => row));
    });
  });
}

// Pictures of a data set: which models, which run.
for (const section of document.querySelectorAll("section.dataset")) {
  const boxes = [...section.querySelectorAll("input[data-toggle]")];
  const show = () => {
    for (const box of boxes) {
      for (const part of section.querySelectorAll(`[data-m="${box.dataset.toggle}"]`)) part.toggleAttribute("hidden", !box.checked);
    }
  };
  boxes.forEach((box) => box.addEventListener("change", show));
  for (const button of section.querySelectorAll("button[data-all]")) {
    button.addEventListener("click", () => {
      boxes.forEach((box) => { box.checked = button.dataset.all === "1"; });
      show();
    });
  }
  const select = section.querySelector("select[data-runs]");
  if (!select) continue;
  const runs = JSON.parse(section.querySelector('script[type="application/json"]').textContent);
  const picture = section.querySelector("[data-stage] > svg");
  const draw = () => {
    const run = runs[select.value];
    picture.innerHTML = run.svg; // numbers and our own words only
    section.querySelector("[data-run]").textContent = run.run;
    for (const cell of section.querySelectorAll("[data-error]")) cell.textContent = run.errors[cell.dataset.error];
    show();
  };
  select.addEventListener("change", draw);
  for (const button of section.querySelectorAll("button[data-step]")) {
    button.addEventListener("click", () => {
      select.selectedIndex = (select.selectedIndex + Number(button.dataset.step) + runs.length) % runs.length;
      draw();
    });
  }
  if (Number(select.value) >= 0) draw(); // a browser may keep the choice over a reload
  show();
}
