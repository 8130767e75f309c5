// What a job will need: what it asks for, what its prediction says, or a guess by its size.
#pragma once

#include "jobs/queue/admission.hpp"
#include "jobs/registry/registry.hpp"
#include "jobs/store/store.hpp"

namespace carillon::queue {

struct JobNeeds {
  Need need;
  double time_limit_s = 0.0;
  bool wants_prediction = false;  // too large to guess, and nothing was asked for
};

/// Reads request.json and prediction.json of the job's folder. A damaged one is as none.
JobNeeds find_needs(const store::Store& store, const registry::Job& job);

/// What the row asks for, which may have changed since the needs were found.
void set_asked(JobNeeds& needs, const registry::Job& job);

/// A guess by the number of nodes of the volume mesh as solved: upper bounds for compact bodies in the whole band.
Need guess_need(double nodes);

}  // namespace carillon::queue
