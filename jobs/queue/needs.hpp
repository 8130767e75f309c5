// What a job will need: what it asks for, what its prediction says, or a guess by its size.
#pragma once

#include "jobs/queue/admission.hpp"
#include "jobs/store/registry/registry.hpp"
#include "jobs/store/store.hpp"
#include "precompute/job/cost/problem_size.hpp"

namespace carillon::queue {

struct JobNeeds {
  Need need;
  double time_limit_s = 0.0;
  bool wants_prediction = false;  // too large to guess, and nothing was asked for
  bool is_simulation = false;
};

/// Reads request.json and prediction.json of the job's folder. A damaged one is as none.
JobNeeds find_needs(const store::Store& store, const registry::Job& job);

/// What the row asks for, which may have changed since the needs were found.
void set_asked(JobNeeds& needs, const registry::Job& job);

/// The need of a problem of which no more than the size is known, by the cost model.
Need guess_need(const cost::ProblemSize& size);

}  // namespace carillon::queue
