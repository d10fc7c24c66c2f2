"""The frame of a page of results: its styles for screens, phones, dark ones and paper, and links that open parts."""

SKELETON = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<title>{title}</title>
<style>
:root {{ color-scheme: light dark; --ink: #222; --paper: #fff; --soft: #555; --line: #ddd; --mark: #0072b2;
  --box: #eef5fa; }}
@media (prefers-color-scheme: dark) {{
  :root {{ --ink: #e6e6e6; --paper: #16181b; --soft: #a9a9a9; --line: #3a3d42; --mark: #56a8dc; --box: #1f2a33; }}
}}
body {{ font: 15px/1.5 system-ui, sans-serif; color: var(--ink); background: var(--paper); max-width: 72em;
  margin: 2em auto; padding: 0 1em; overflow-wrap: anywhere; }}
h1 {{ line-height: 1.2; }}
h2 {{ font-size: 1.25em; margin: 1.6em 0 0.6em; border-bottom: 2px solid var(--mark); }}
summary h2 {{ display: inline-block; border: 0; margin: 0; }}
details {{ border-bottom: 1px solid var(--line); padding: 0.5em 0; }}
summary {{ cursor: pointer; }}
a {{ color: var(--mark); }}
nav {{ color: var(--soft); margin: 1em 0; }}
.verdict details {{ border: 0; color: var(--soft); }}
.verdict {{ border-left: 5px solid var(--mark); background: var(--box); padding: 0.3em 1em; font-size: 1.07em; }}
.table {{ overflow-x: auto; margin: 1em 0; }}
table {{ border-collapse: collapse; font-variant-numeric: tabular-nums; overflow-wrap: normal; }}
caption {{ text-align: left; font-weight: 600; padding-bottom: 0.3em; }}
th, td {{ text-align: left; vertical-align: top; padding: 0.15em 0.8em 0.15em 0;
  border-bottom: 1px solid var(--line); }}
th {{ vertical-align: bottom; }}
td {{ min-width: 4em; max-width: 28em; }}
.number {{ text-align: right; white-space: nowrap; }}
th.number {{ white-space: normal; }}
img {{ max-width: 100%; height: auto; background: #fff; }}
figure {{ margin: 1.5em 0; }}
.sheet img {{ width: 54em; border: 1px solid var(--line); }}
figcaption, footer {{ color: var(--soft); }}
footer {{ margin-top: 3em; border-top: 1px solid var(--line); font-size: 0.9em; }}
pre {{ white-space: pre-wrap; }}
@media (max-width: 40em) {{ body {{ margin: 1em auto; font-size: 14px; }} }}
@media print {{
  @page {{ size: A4; margin: 8mm 10mm; }}
  :root {{ color-scheme: light; --ink: #222; --paper: #fff; --soft: #555; --line: #ddd; --box: #eef5fa; }}
  body {{ font-size: 9pt; max-width: none; margin: 0; padding: 0; }}
  nav, details:not([open]), h1:has(+ .sheet) {{ display: none; }}
  .table {{ overflow-x: visible; }}
  table {{ font-size: 8pt; }}
  th, td {{ padding-right: 0.5em; min-width: 0; }}
  h2, h3, caption {{ break-after: avoid; }}
  figure, tr, .verdict {{ break-inside: avoid; }}
  img {{ max-height: 230mm; }}
  .sheet {{ margin: 0; text-align: center; break-after: page; }}
  .sheet img {{ width: auto; height: 270mm; max-height: none; border: 0; }}
  .sheet figcaption {{ display: none; }}
}}
</style>
<script>
function show() {{
  const part = document.getElementById(location.hash.slice(1))?.closest("details");
  if (part) {{ part.open = true; part.scrollIntoView(); }}
}}
addEventListener("hashchange", show);
addEventListener("load", show);
</script>
</head>
<body>
{body}
</body>
</html>
"""
