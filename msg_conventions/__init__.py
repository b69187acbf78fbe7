"""Message ⇄ domain type: the one place where a message is made or read, straight between arrays and CDR bytes, without ROS."""
