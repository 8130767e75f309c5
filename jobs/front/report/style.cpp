#include "jobs/front/report/html.hpp"

namespace carillon::report {

Html get_style() {
  return html("{}", escape(R"(
:root { --ink: #23272f; --soft: #667080; --line: #dfe3e8; --c0: #2b6cb0; --c1: #d97706; --c2: #2f855a; --bad: #c02a2a; }
* { box-sizing: border-box }
body { margin: 0; background: #f6f7f9; color: var(--ink); font: 15px/1.5 system-ui, DejaVu Sans, Liberation Sans, sans-serif }
main { max-width: 1020px; margin: 0 auto; padding: 28px 16px 60px }
header, section { background: #fff; border: 1px solid var(--line); border-radius: 8px; padding: 20px 28px; margin: 0 0 18px }
h1 { font-size: 27px; margin: 0; overflow-wrap: anywhere }
h2 { font-size: 19px; margin: 0 0 10px }
h3 { font-size: 15px; margin: 20px 0 6px }
p { margin: 8px 0; overflow-wrap: anywhere }
a { color: var(--c0) }
iframe { width: 100%; height: 620px; border: 0; border-radius: 8px; background: #12161c }
.remark, .missing { color: var(--soft); font-size: 13px }
section.missing { padding: 14px 28px }
section.missing h2 { font-size: 16px; margin: 0; color: var(--soft) }
.verdict { border-left: 4px solid; padding: 6px 14px; margin: 14px 0; background: #f8f9fb }
.good { border-color: var(--c2) }
.fair { border-color: var(--c1) }
.bad { border-color: var(--bad) }
.note { border-left: 4px solid var(--c1); background: #fdf6ea; padding: 4px 14px; margin: 14px 0; overflow-wrap: anywhere }
.note ul { margin: 4px 0; padding-left: 18px }
.tiles { display: grid; grid-template-columns: repeat(auto-fit, minmax(132px, 1fr)); gap: 12px; margin-top: 16px }
.tile { border: 1px solid var(--line); border-radius: 6px; padding: 10px 12px }
.tile .what { color: var(--soft); font-size: 13px }
.tile .value { font-size: 21px; font-variant-numeric: tabular-nums; white-space: nowrap }
nav { display: flex; flex-wrap: wrap; gap: 4px 14px; margin: 0 0 18px; font-size: 14px }
.table { overflow: auto; max-height: 900px; margin: 10px 0 }
table { border-collapse: collapse; font-size: 14px; font-variant-numeric: tabular-nums }
th, td { text-align: left; padding: 4px 16px 4px 0; border-bottom: 1px solid var(--line); vertical-align: top }
th { font-weight: 600; color: var(--soft) }
thead th { position: sticky; top: 0; background: #fff }
td { overflow-wrap: anywhere }
.n { text-align: right; white-space: nowrap }
.facts { table-layout: fixed; width: 100% }
.facts th { font-weight: 400; width: 210px }
.facts td.n { text-align: left; white-space: normal; width: 330px }
.ok { color: var(--c2) }
.fault { color: var(--bad); font-weight: 600 }
details { margin: 10px 0 }
summary { cursor: pointer; color: var(--c0) }
pre { background: #f6f7f9; border: 1px solid var(--line); border-radius: 6px; padding: 12px; overflow: auto; max-height: 520px; font-size: 13px; margin: 0 }
img { max-width: 100%; height: auto; display: block; margin: 0 auto }
.chart { overflow-x: auto; margin: 10px 0 }
svg { display: block; width: 100%; min-width: 560px; height: auto }
svg text { font-size: 13px; fill: var(--ink) }
svg .tick text { font-size: 12px; fill: var(--soft) }
svg .grid path { stroke: var(--line); stroke-width: 1; fill: none }
svg .c0 { fill: var(--c0) }
svg .c1 { fill: var(--c1) }
svg .c2 { fill: var(--c2) }
svg .dot { opacity: .85 }
svg path.c0 { stroke: var(--c0) }
svg path.c1 { stroke: var(--c1) }
svg path.c2 { stroke: var(--c2) }
svg .stick { fill: none; stroke-width: 1; opacity: .35 }
svg .bar { fill: none; stroke-width: 1.2; opacity: .5 }
svg .dots { fill: none; stroke-width: 5; stroke-linecap: round; opacity: .6 }
svg path.level { stroke: var(--bad); stroke-width: 1; stroke-dasharray: 5 4; fill: none }
svg text.level { fill: var(--bad); font-size: 12px }
.legend { font-size: 13px; color: var(--soft); text-align: center }
.key { display: inline-block; width: 11px; height: 11px; border-radius: 50%; margin: 0 6px 0 16px; vertical-align: -1px }
.key.c0 { background: var(--c0) }
.key.c1 { background: var(--c1) }
.key.c2 { background: var(--c2) }
@media (max-width: 700px) {
  main { padding: 12px 8px 40px }
  header, section, section.missing { padding: 14px }
  iframe { height: 80vh }
  .facts, .facts tbody, .facts tr, .facts th, .facts td, .facts td.n { display: block; width: auto }
  .facts tr { padding: 4px 0; border-bottom: 1px solid var(--line) }
  .facts th, .facts td { padding: 0; border: 0 }
}
@media print { body { background: #fff } section, header { break-inside: avoid; border: 0 } .table, pre { max-height: none } }
)",
                           100000));
}

}  // namespace carillon::report
