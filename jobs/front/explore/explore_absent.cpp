// carillon explore in a build without the component PAGE. Other commands leave the page out.
#include "jobs/front/explore/explore.hpp"
#include "jobs/front/explore/serve.hpp"
#include "runtime/base/component.hpp"

namespace carillon::explore {

Explored explore(const PageOrder&) { base::refuse_missing("carillon explore", "PAGE"); }
bool is_installed() { return false; }
bool is_explorer(const std::filesystem::path&) { base::refuse_missing("carillon explore", "PAGE"); }
int serve(const std::filesystem::path&, const std::map<std::string, std::filesystem::path>&, int,
          const std::function<void(const std::string&)>&) {
  base::refuse_missing("carillon explore", "PAGE");
}

}  // namespace carillon::explore
