// Formulas between \( \) and \[ \], as the Markdown extension arithmatex leaves them, by KaTeX.
for (const element of document.querySelectorAll(".arithmatex")) {
  const text = element.textContent.trim()
  const displayMode = text.startsWith("\\[")
  // TeX takes d_\min, KaTeX wants d_{\min}.
  const formula = text.slice(2, -2).replace(/([_^])(\\(?:min|max|log|ln|exp)\b)/g, "$1{$2}")
  katex.render(formula, element, { displayMode, throwOnError: false })
}
