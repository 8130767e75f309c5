// carillon-bank export, import, silent and compare with measurements in a build without the component EXCHANGE.
#include "runtime/base/component.hpp"
#include "runtime/exchange/commands.hpp"

namespace carillon::exchange {

void run_export(const ExportWishes&) { base::refuse_missing("export", "EXCHANGE"); }
void run_measured(const MeasuredWishes&) { base::refuse_missing("compare with measurements", "EXCHANGE"); }
void run_import(const ImportWishes&) { base::refuse_missing("import", "EXCHANGE"); }
void run_silent(const SilentWishes&) { base::refuse_missing("silent", "EXCHANGE"); }

}  // namespace carillon::exchange
