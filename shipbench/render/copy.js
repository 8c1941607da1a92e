"use strict";
// A button `data-copy` puts the text of the `pre` behind it on the clipboard; where that is not allowed, the text is selected.
for (const button of document.querySelectorAll("button[data-copy]")) {
  const text = button.nextElementSibling;
  const name = button.textContent;
  button.addEventListener("click", async () => {
    getSelection().selectAllChildren(text);
    try {
      await navigator.clipboard.writeText(text.textContent);
      button.textContent = "copied";
    } catch {
      button.textContent = "selected: press Ctrl+C";
    }
    setTimeout(() => { button.textContent = name; }, 2000);
  });
}
