"use strict";
// Starts a page: draws its figures, and adapts them if the width, the colours or the medium change.

const AHEAD = 1000; // px below the window up to which figures are drawn; the others wait until they come near
readPalette();
const holders = document.querySelectorAll(".plot");
const near = new IntersectionObserver((seen) => { for (const one of seen) if (one.isIntersecting) draw(one.target); }, { rootMargin: `${AHEAD}px` });
for (const holder of holders) {
  if (holder.getBoundingClientRect().top < innerHeight + AHEAD) draw(holder); // at once: a screenshot does not wait
  else near.observe(holder);
}
new ResizeObserver(() => fit()).observe(root.querySelector("main"));
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", recolour);
addEventListener("beforeprint", () => {
  root.classList.add("paper");
  fit();
  recolour();
  holders.forEach(draw);
});
addEventListener("afterprint", () => {
  root.classList.remove("paper");
  fit();
  recolour();
});
