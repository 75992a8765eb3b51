// The Python module surfsup.native._native.
#include "bindings/arrays.hpp"

NB_MODULE(_native, module) {
    nb::set_leak_warnings(false);  // objects that Python caches until it exits are no leaks
    module.def("instruction_sets", [] {
        std::vector<std::string> names;
        for (const surfsup::Isa* isa : surfsup::instruction_sets()) names.emplace_back(isa->name);
        return names;
    });
    add_solids(module);
    add_solver(module);
    add_networks(module);
    add_message_passing(module);
}
