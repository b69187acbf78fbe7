"use strict";
// Of every page: tables are sorted by a click on a head, and filtered by the words that are typed; a list of contents leads to the headings of the shown case.

document.querySelectorAll("table[data-sort]").forEach((table) => {
  const body = table.tBodies[0];
  table.querySelectorAll("thead th").forEach((head, k) => {
    const button = document.createElement("button");
    button.type = "button";
    button.className = "sort";
    button.append(...head.childNodes);
    head.append(button);
    button.addEventListener("click", () => {
      const up = head.ariaSort !== "ascending";
      table.querySelectorAll("thead th").forEach((other) => { other.ariaSort = other === head ? (up ? "ascending" : "descending") : null; });
      const value = (row) => { const text = row.cells[k].dataset.value ?? row.cells[k].textContent.trim(); return [parseFloat(text), text]; };
      const order = ([a, s], [b, t]) => (Number.isNaN(a) && Number.isNaN(b) ? s.localeCompare(t) : Number.isNaN(a) ? 1 : Number.isNaN(b) ? -1 : a - b);
      const rows = [...body.rows].map((row) => [value(row), row]).sort(([a], [b]) => (up ? order(a, b) : order(b, a)));
      body.append(...rows.map(([, row]) => row));
    });
  });
});

document.querySelectorAll("table[data-filter]").forEach((table) => {
  const label = document.createElement("label");
  const input = document.createElement("input");
  input.type = "search";
  label.append("Show rows with ", input);
  table.parentElement.before(label);
  input.addEventListener("input", () => {
    const words = input.value.toLowerCase().split(/\s+/);
    [...table.tBodies[0].rows].forEach((row) => { row.hidden = !words.every((word) => row.textContent.toLowerCase().includes(word)); });
  });
});

document.querySelectorAll("nav.contents").forEach((nav, n) => {
  const list = document.createElement("ul");
  nav.closest("section").querySelectorAll("h2").forEach((heading, k) => {
    if (k === 0) return; // the name of the case
    heading.id = `part-${n}-${k}`;
    const item = document.createElement("li");
    const link = document.createElement("a");
    link.href = `#${heading.id}`;
    link.textContent = heading.textContent;
    link.addEventListener("click", () => { if (heading.closest("details")) heading.closest("details").open = true; });
    item.append(link);
    list.append(item);
  });
  nav.append(list);
});
