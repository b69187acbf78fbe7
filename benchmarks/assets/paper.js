"use strict";
// The page of the paper's figures: each is drawn where the page has a place for it.

for (const [place, figure] of Object.entries(JSON.parse(document.getElementById("data").textContent))) {
  Plotly.newPlot(place, figure.data, figure.layout, { displayModeBar: false, responsive: true });
}
