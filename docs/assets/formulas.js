// Formulas between \( \) and \[ \], as the Markdown extension arithmatex leaves them, by KaTeX.
for (const element of document.querySelectorAll(".arithmatex")) {
  const text = element.textContent.trim()
  const displayMode = text.startsWith("\\[")
  katex.render(text.slice(2, -2), element, { displayMode, throwOnError: false })
}
