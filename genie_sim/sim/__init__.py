"""Time: hosts that compute, links that carry, ROS graphs that connect them, and the world that is
built of all three, as SimPy processes.

By subject:

- The run: ``settings`` (who drives where), ``setup`` (what a world is built from), ``world``
  (builds it and lets time run), ``clock`` (time, and the queue in which messages wait),
  ``monitor`` (what an observer is told).
- Cars: ``places`` (where a car is), ``cameras``, ``content`` (what an image carries),
  ``frame_rate``, ``listener`` (takes the answers).
- Hosts: ``host`` (processors; here times are drawn), ``device`` (their laws), ``draw_keys``
  (which random number belongs to what).
- ROS: ``ros_graph`` (topics, queues, threads of nodes), ``nodes`` (detector and Genie),
  ``batching``, ``encoding``, ``method`` (what a method puts on a host), ``connectivity``
  (checks).
- The network: ``network`` (all hosts and links), ``link`` (its queue and way), ``link_model``
  (what a type of link is), ``message_random``, ``interface``, ``connection`` (of a car),
  ``topology`` (of edges).
- Faults: ``fault`` (what one is), ``fault_process`` (begins and ends it), ``bends`` (what faults
  change of messages).

Words that all of these use:

- The *path* of a message: the spans of time since its frame was taken, by what took them.
  ``clock.path`` is that of the message which is handled now (``clock.Clock`` says how to keep it).
- The ``sender`` of a message: the name of the node that published it, also on another host.
- A *flow*: messages that push each other out of a queue, such as those of a topic or a camera.
- A fault may *bend* a host (change what crosses its border), *void* it (what is queued and in
  service is lost), and make its nodes *lose memory* (they start anew).
"""
