"use strict";
// The list of scenarios: filtered, sorted and paged. What is drawn of all scenarios is its page.

const PER_PAGE = 50;

class ScenarioList {
  /** @param changed is called when another page is shown; @param choose with the index of a scenario. */
  constructor(section, data, set, changed, choose) {
    this.find = (role) => section.querySelector(`[data-role="${role}"]`);
    [this.set, this.changed, this.choose] = [set, changed, choose];
    this.columns = Object.entries(data.coverage ? data.coverage.figures : {}).map(([name, figure]) => ({ name, ...figure }));
    const rowOf = new Map(data.coverage ? data.coverage.index.map((index, k) => [index, k]) : []);
    this.rows = set.index.map((index, k) => ({ index, k, outcome: set.outcome[k], values: this.columns.map((column) => column.values[rowOf.get(index)] ?? null) }));
    this.first = 0;
    this.order = { column: -1, up: true };
    const outcomes = [...new Set(set.outcome)].filter(Boolean);
    this.find("outcome").append(option("", "all outcomes"), ...outcomes.map((words) => option(words, words)));
    this.find("outcome").parentElement.hidden = outcomes.length < 2;
    this.hasOutcomes = outcomes.length > 0;
    this.find("figure").append(...this.columns.map((column, c) => option(c, `${column.label} [${column.unit}]`)));
    this.find("figure").parentElement.parentElement.hidden = !this.columns.length;
    ["figure", "low", "high", "outcome"].forEach((role) => this.find(role).addEventListener("input", () => { this.first = 0; this.update(); }));
    [["earlier", -PER_PAGE], ["later", PER_PAGE]].forEach(([role, by]) => this.find(role).addEventListener("click", () => { this.first += by; this.update(); }));
    this.head();
    this.update();
  }

  /** The heads, which sort. */
  head() {
    const titles = ["scenario", ...this.columns.map((column) => `${column.label} [${column.unit}]`), ...(this.hasOutcomes ? ["outcome"] : [])];
    this.find("list-head").replaceChildren(...titles.map((title, k) => {
      const cell = document.createElement("th");
      const button = document.createElement("button");
      button.type = "button";
      button.className = "sort";
      button.textContent = title;
      button.addEventListener("click", () => {
        this.order = { column: k - 1, up: this.order.column === k - 1 ? !this.order.up : true };
        [...this.find("list-head").cells].forEach((other) => { other.ariaSort = other === cell ? (this.order.up ? "ascending" : "descending") : null; });
        this.first = 0;
        this.update();
      });
      cell.append(button);
      return cell;
    }));
  }

  /** Scenarios within the range, in order; those without the figure are last. */
  chosen() {
    const [low, high] = ["low", "high"].map((role) => (this.find(role).value === "" ? null : Number(this.find(role).value)));
    const c = Number(this.find("figure").value);
    const outcome = this.find("outcome").value;
    const inside = ({ values }) => (low === null || (values[c] !== null && values[c] >= low)) && (high === null || (values[c] !== null && values[c] <= high));
    const rows = this.rows.filter((row) => inside(row) && (!outcome || row.outcome === outcome));
    const { column, up } = this.order;
    const key = (row) => (column < 0 ? row.index : column < this.columns.length ? row.values[column] : row.outcome);
    const compare = (a, b) => (a === null || b === null ? (a === null) - (b === null) : (a < b ? -1 : Number(a > b)) * (up ? 1 : -1));
    return rows.sort((a, b) => compare(key(a), key(b)));
  }

  update() {
    const rows = this.chosen();
    this.first = Math.max(0, Math.min(this.first, rows.length - 1));
    this.first -= this.first % PER_PAGE;
    const page = rows.slice(this.first, this.first + PER_PAGE);
    this.set.shown = page.map((row) => row.k);
    this.find("earlier").disabled = this.first === 0;
    this.find("later").disabled = this.first + PER_PAGE >= rows.length;
    const all = rows.length === this.rows.length ? "" : `matching scenarios, out of ${this.rows.length}`;
    this.find("drawn").textContent = page.length ? `Listed and drawn: ${this.first + 1} to ${this.first + page.length} of ${rows.length} ${all || "scenarios"}.` : "No scenario matches.";
    this.find("list").replaceChildren(...page.map((row) => this.line(row)));
    this.changed();
  }

  line(row) {
    const line = document.createElement("tr");
    line.dataset.index = row.index;
    const button = document.createElement("button");
    button.type = "button";
    button.textContent = row.index;
    const texts = row.values.map((value) => (value === null ? "–" : value.toFixed(2)));
    if (this.hasOutcomes) texts.push(row.outcome);
    line.append(...[button, ...texts].map((content) => {
      const cell = document.createElement("td");
      cell.append(content);
      return cell;
    }));
    line.addEventListener("click", () => this.choose(row.index));
    return line;
  }

  /** Mark the scenario that the film shows. */
  mark(index) {
    [...this.find("list").rows].forEach((line) => line.setAttribute("aria-current", String(Number(line.dataset.index) === index)));
  }
}
