#include "jobs/queue/repair.hpp"

#include <fmt/core.h>

#include "jobs/store/identity.hpp"

namespace carillon::queue {

std::optional<store::Request> find_request(const store::Store& store, const registry::Registry& registry, const store::Id& id) {
  const auto fits = [&](const store::Request& request) { return request.id == id.text() && store::calc_id(request) == id; };
  for (const std::filesystem::path& folder : {store.work_folder(id), store.bank_folder(id)}) {
    try {
      if (const std::optional<store::Request> request = store::read_request(folder); request && fits(*request)) return request;
    } catch (const InputError&) {
    }
  }
  for (const registry::Submission& submission : registry.list_last_submissions()) {
    if (submission.request.id == id.text() && fits(submission.request)) return submission.request;
  }
  return std::nullopt;
}

std::optional<std::string> restore(const store::Store& store, const registry::Registry& registry, const store::Id& id) {
  const bool is_whole = store.has_work(id) && !store::find_job_fault(store, id);
  const std::optional<store::Request> request = find_request(store, registry, id);
  if (!request) return "its request is no longer in the store; submit it again";
  const std::optional<std::string> fault = store::find_input_fault(store, *request);
  if (fault && !store::restore_input(store, *request))
    return fmt::format("{}, and {} has been removed or changed; submit the job with its {}", *fault,
                       request->inputs.empty() ? request->input_file : "a file of it",
                       request->inputs.empty() ? to_text(request->input_kind) : "meshes");
  if (store.has_bank_folder(id)) store.set_bank_aside(id);
  if (!is_whole) store::restore_work(store, *request);
  return std::nullopt;
}

}  // namespace carillon::queue
