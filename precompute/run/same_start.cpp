#include "precompute/run/same_start.hpp"

#include <fmt/core.h>

#include <algorithm>
#include <system_error>

#include "runtime/base/error.hpp"
#include "runtime/base/file.hpp"
#include "runtime/base/sha256.hpp"

namespace carillon::run {

namespace fs = std::filesystem;

Given look_at_job(const fs::path& file, std::uint64_t max_bytes) {
  Given given{fs::absolute(file).lexically_normal().string(), {}};
  try {
    given.forms = {base::to_hex(base::calc_sha256(base::read_file(file, "job file", max_bytes)))};
  } catch (const std::exception&) {  // may exist on the machine of rank 0 only
  }
  return given;
}

Given look_at_place(const fs::path& file) {
  if (file.empty()) return {"none", {""}};
  const fs::path place = fs::absolute(file).lexically_normal();
  std::error_code error;
  return {place.string(), {place.string(), fs::weakly_canonical(place, error).string()}};
}

void check_same(const comm::Communicator& comm, const std::string& what, const Given& given) {
  if (comm.size() == 1) return;
  const std::vector<base::Sha256::Hash> own = comm.agree([&] {
    std::vector<base::Sha256::Hash> sums;
    for (const std::string& form : given.forms) sums.push_back(base::calc_sha256(form));
    return sums;
  });
  const std::vector<base::Sha256::Hash> first = comm.broadcast(std::vector(own));
  const bool is_known = !first.empty() && !own.empty();
  const bool is_same = !is_known || std::find_first_of(own.begin(), own.end(), first.begin(), first.end()) != own.end();
  if (comm.max(std::int32_t{!is_same}) == 0) return;
  const std::string shown = comm.broadcast(std::string(given.shown));
  comm.agree(is_same
                 ? std::string()
                 : fmt::format("the ranks of one run were given different {}: rank 0 has {}, and rank {} has {}; they do one job together: "
                               "start each job by itself (mpirun -np N ... JOB.json), or all by carillon submit",
                               what, shown, comm.rank(), given.shown));
}

}  // namespace carillon::run
