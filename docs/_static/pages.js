// A link of class "turn" shows its page in place of the picture before it.
for (const link of document.querySelectorAll("a.turn")) {
  link.addEventListener("click", (event) => {
    const pictures = [...document.querySelectorAll("article img.sphx-glr-single-img, article img.sphx-glr-multi-img")];
    const picture = pictures.filter((one) => one.compareDocumentPosition(link) & Node.DOCUMENT_POSITION_FOLLOWING).pop();
    if (!picture || event.ctrlKey || event.metaKey || event.shiftKey) return;
    event.preventDefault();
    const frame = document.createElement("iframe");
    frame.className = "live";
    frame.title = `${picture.alt}, to turn around`;
    frame.src = link.href;
    picture.replaceWith(frame);
    link.parentElement.remove();
  });
}

// What scrolls sideways can be reached by the keyboard.
function reachScrolling() {
  for (const box of document.querySelectorAll("article pre, article .table-wrapper, article div.math")) {
    if (box.scrollWidth > box.clientWidth) box.tabIndex = 0;
    else box.removeAttribute("tabindex");
  }
}
reachScrolling();
addEventListener("resize", reachScrolling);
