// Contact tracker of examples without playback: writes its events as a contacts file (docs/howto/contacts-file.md). C++14.
#pragma once

#include <carillon.h>

#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <map>
#include <string>

#include "message.hpp"

class ContactsFile {
 public:
  explicit ContactsFile(carillon_touches_options options) {
    options.sink = [](void* self, std::int32_t kind, const void* event) { static_cast<ContactsFile*>(self)->take(kind, event); };
    options.user = this;
    message_.check(carillon_touches_create(nullptr, &options, &touches_, message_.text(), message_.size()));
  }
  ~ContactsFile() {
    carillon_touches_destroy(touches_);
    for (const auto& bank : banks_) carillon_bank_close(bank.second);
  }
  ContactsFile(const ContactsFile&) = delete;
  ContactsFile& operator=(const ContactsFile&) = delete;

  /// Adds a body; bodies may share a bank. Returns its index in the tracker and in the file.
  std::int32_t add(const std::string& bank_file, const std::string& name, double restitution, double friction, bool is_fixed = false) {
    carillon_bank*& bank = banks_[bank_file];
    if (bank == nullptr) message_.check(carillon_bank_open(bank_file.c_str(), &bank, message_.text(), message_.size()));
    carillon_touches_body body;
    carillon_touches_body_init(&body);
    body.body = count_;
    body.fixed = is_fixed ? 1 : 0;
    body.bank = bank;
    body.name_seed = carillon_name_seed(name.c_str());
    body.restitution = restitution;
    body.friction = friction;
    message_.check(carillon_touches_add(touches_, &body, &count_, message_.text(), message_.size()));
    append(names_, "%s{\"name\": \"%s\", \"triangles\": %d}", names_.empty() ? "" : ", ", name.c_str(), carillon_bank_triangle_count(bank));
    return count_++;
  }
  const carillon_bank* get_bank(const std::string& bank_file) const { return banks_.at(bank_file); }
  carillon_touches* get_touches() const { return touches_; }

  /// Writes all events so far. Ends the program if that fails.
  void write(const char* file) const {
    std::FILE* out = std::fopen(file, "w");
    const bool is_written = out != nullptr &&
                            std::fprintf(out, "{\"carillon_contacts\": 1, \"bodies\": [%s], \"events\": %lld}\n", names_.c_str(),
                                         static_cast<long long>(events_)) > 0 &&
                            std::fwrite(lines_.data(), 1, lines_.size(), out) == lines_.size();
    if (out == nullptr || std::fclose(out) != 0 || !is_written) std::fprintf(stderr, "%s: cannot be written\n", file), std::exit(1);
  }

 private:
  __attribute__((format(printf, 2, 3))) static void append(std::string& to, const char* format, ...) {
    char text[1000];
    va_list numbers;
    va_start(numbers, format);
    std::vsnprintf(text, sizeof text, format, numbers);
    va_end(numbers);
    to += text;
  }
  void vector(const char* key, const double x[3]) { append(lines_, ", \"%s\": [%.10g, %.10g, %.10g]", key, x[0], x[1], x[2]); }
  void number(const char* key, double x) { append(lines_, ", \"%s\": %.10g", key, x); }
  template <class Event>
  void place(const char* kind, const Event& e) {
    append(lines_, "{\"%s\": {\"time_s\": %.17g, \"body\": %d, \"other\": %d, \"triangle\": %d", kind, e.time_s, e.body, e.other,
           e.triangle);
    vector("barycentric", e.barycentric);
  }

  void take(std::int32_t kind, const void* event) {
    ++events_;
    if (kind == CARILLON_EVENT_MARK) {
      append(lines_, "{\"mark\": {\"time_s\": %.17g", *static_cast<const double*>(event));
    } else if (kind == CARILLON_EVENT_IMPULSE) {
      const auto& e = *static_cast<const carillon_impulse*>(event);
      place("impulse", e);
      vector("impulse_n_s", e.impulse_n_s);
      number("duration_s", e.duration_s);
    } else if (kind == CARILLON_EVENT_FORCE) {
      const auto& e = *static_cast<const carillon_force*>(event);
      place("force", e);
      number("step_s", e.step_s);
      append(lines_, ", \"continues\": %s, \"impulse_n_s\": [", e.continues != 0 ? "true" : "false");
      for (int k = 0; k < e.count; ++k)
        append(lines_, "%s[%.9g, %.9g, %.9g]", k > 0 ? ", " : "", e.impulse_n_s[k][0], e.impulse_n_s[k][1], e.impulse_n_s[k][2]);
      lines_ += "]";
    } else if (kind == CARILLON_EVENT_CONTACT) {
      const auto& e = *static_cast<const carillon_contact*>(event);
      static const char* const kStates[] = {"begin", "hold", "end"};
      place("contact", e);
      append(lines_, ", \"id\": %llu, \"state\": \"%s\"", static_cast<unsigned long long>(e.id), kStates[e.state]);
      vector("normal", e.normal);
      vector("slip_m_s", e.slip_m_s);
      number("force_n", e.force_n);
      number("sweep_m_s", e.sweep_m_s);
      number("other_sweep_m_s", e.other_sweep_m_s);
      number("spin_rad_s", e.spin_rad_s);
      number("patch_radius_m", e.patch_radius_m);
      number("impedance_n_s_m", e.impedance_n_s_m);
    } else {
      const auto& e = *static_cast<const carillon_motion*>(event);
      append(lines_, "{\"motion\": {\"time_s\": %.17g, \"body\": %d", e.time_s, e.body);
      vector("position_m", e.position_m);
      vector("velocity_m_s", e.velocity_m_s);
      append(lines_, ", \"rotation\": [%.10g, %.10g, %.10g, %.10g], \"cut\": %s", e.rotation[0], e.rotation[1], e.rotation[2],
             e.rotation[3], e.cut != 0 ? "true" : "false");
    }
    lines_ += "}}\n";
  }

  Message message_;
  carillon_touches* touches_ = nullptr;
  std::map<std::string, carillon_bank*> banks_;
  std::string names_, lines_;
  std::int32_t count_ = 0;
  std::int64_t events_ = 0;
};
