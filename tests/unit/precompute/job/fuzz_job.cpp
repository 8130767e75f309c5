// Fuzzes jobs: the resolved form reads back to itself, or an InputError.
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "precompute/job/job_spec.hpp"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* bytes, std::size_t size) {
  using namespace carillon::job;
  try {
    const JobSpec job = parse_job({reinterpret_cast<const char*>(bytes), size}, "/a/job.json");
    const std::string resolved = resolved_json(job, "/a", "");
    if (resolved_json(parse_job(resolved, "/a/resolved.json"), "/a", "") != resolved) std::abort();
  } catch (const carillon::InputError&) {
  }
  return 0;
}
