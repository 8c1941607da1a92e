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
