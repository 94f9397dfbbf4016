"""What a port is, the groups that ports come in, and how they are written down for hosts.

======================== =================================================================
module                   what it states
======================== =================================================================
:mod:`.quantities`       what passes through groups of ports: members and their units
:mod:`.port`             one port: its declaration and what values it takes
:mod:`.groups`           flat values of ports from groups, and groups from flat values
:mod:`.units`            units and what they are in SI units
:mod:`.variable`         a field of a class as a port, or as a group of them
:mod:`.definition`       all that the modules of a component say of it
:mod:`.behaviour`        what a component's behaviour may say: the hooks of both kinds
:mod:`.vehicle`          parameters of (2) and (3), and the reference
:mod:`.controllers`      what the controllers have in common
:mod:`.tail`             ports of the REMUS 100's tail and of what moves it
:mod:`.description`      modelDescription.xml of FMI 2.0, and what all versions share
:mod:`.description_fmi3` what a host reads of FMI 3.0: description, build, terminals
======================== =================================================================

`ports.py` of a component declares

- `DESCRIPTION`, one line;
- `PARAMETERS`, a :class:`~.groups.ParameterSet`: which parameters make the NamedTuple that the
  equations take;
- `PORTS`, all inputs, outputs and parameters in the order of their value references, which hosts
  keep: what comes later stands at the end (`PARAMETERS.before`). :data:`~.port.H_MAX` is among them
  if the component has internal steps;
- `GROUP_OF`, if fields of its inputs bear other names than their groups of ports.

Which inputs, outputs and state it has is said by the types in its `behaviour.py`
(:mod:`.behaviour`); both are held against each other when an FMU is built.
"""
