// The script of a page that `translucent page` writes: it shows the scene that the page holds.
import { createViewer } from "../src/viewer/index.js";

const element = document.getElementById("viewer");
const payload = document.getElementById("scene").textContent.trim();
window.translucent = createViewer(element, payload).then((viewer) => {
  viewer.panel.focus();
  return viewer;
}, (error) => {
  const told = document.createElement("p");
  told.className = "failed";
  told.textContent = `This page cannot show its scene: ${error.message}.`;
  element.append(told);
  console.warn(`translucent: ${error.message}`);
});
